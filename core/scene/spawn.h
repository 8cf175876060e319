#pragma once

#include <array>

#include "core/math/affine.h"
#include "core/math/hit.h"
#include "core/math/ray.h"
#include "core/scene/scene.h"
#include "core/scene/world_plane.h"

namespace gridcast::scene {

/// Where the secondary rays of a hit start: off the triangle's plane, on the side that they leave to, by no
/// more than what the numbers demand. There is no epsilon to choose.
///
/// A ray that starts at such an origin, with a direction that does not lead back to the plane, does not hit
/// the triangle again, in `robust` and `exact` mode, whatever the transform; spawn.cpp has the proof. A hit
/// of `fast` mode may be off by as much as a float: there, and at no cost elsewhere, trace with primitive()
/// as the excluded one.
///
/// World space, metres, doubles. A ray that is rounded to float afterwards loses what is promised.
class SpawnPoint {
 public:
  /// `hit` is a hit of `scene`, which must outlive this.
  SpawnPoint(const Scene& scene, const SurfaceHit& hit);

  /// The hit point by its weights (u, v), which is nearer to the triangle than origin + t * direction: its
  /// error knows nothing of how far the ray came.
  [[nodiscard]] const Vec3d& position() const { return position_; }
  [[nodiscard]] PrimitiveRef primitive() const { return primitive_; }

  /// The ray from the surface into `direction`, on the side that it leads to: reflected or transmitted alike.
  /// [0, infinity].
  [[nodiscard]] Ray ray(const Vec3d& direction) const;
  /// The ray from the surface to `target`, which it reaches at its end: [0, 1].
  [[nodiscard]] Ray ray_to(const Vec3d& target) const;
  /// `from`, a point near the triangle, where it is far enough off the plane on the side that `towards`
  /// points to; otherwise moved along the normal until it is.
  [[nodiscard]] Vec3d origin(const Vec3d& from, const Vec3d& towards) const;

 private:
  [[nodiscard]] Vec3d off_plane(const Vec3d& from, double side) const;
  [[nodiscard]] double shortfall(const Vec3d& origin, double side) const;

  const InstanceTransform& transform_;
  std::array<Vec3f, 3> corners_;
  WorldPlane plane_;
  PrimitiveRef primitive_;
  Vec3d position_;
  Vec3d unit_;           ///< the plane's normal, of length 1
  double length_ = 0.0;  ///< of the plane's normal
  Vec3d object_pull_;    ///< height by which a unit of error per axis in object space counts, at most
  Vec3d drift_;          ///< height by which a unit of direction per axis is lost on the way to object space
};

}  // namespace gridcast::scene
