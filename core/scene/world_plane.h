#pragma once

#include <array>

#include "core/math/affine.h"
#include "core/math/certified.h"
#include "core/math/ray.h"

namespace gridcast::scene {

/// The plane of a triangle of an instance: the one through A p + T in real arithmetic, A and T being the
/// doubles of world_from_object and p the floats of the corners. Nothing is rounded before a bound counts it,
/// so an ill-conditioned instance is as good as any.
class WorldPlane {
 public:
  WorldPlane(const Affine& world_from_object, const std::array<Vec3f, 3>& corners);

  /// normal() . (p - plane): positive on the side that the normal points to.
  [[nodiscard]] Certified height(const Vec3d& p) const { return height(certified(p)); }
  /// The same for the point o + t d of a ray, the sum not rounded.
  [[nodiscard]] Certified height(const Ray& ray, double t) const;
  /// The same for A p + T, the image of a point of object space.
  [[nodiscard]] Certified height_of_object_point(const Vec3d& p) const;
  /// normal() . v
  [[nodiscard]] Certified along(const Vec3d& v) const { return dot(normal_, certified(v)); }
  /// (A p1 - A p0) x (A p2 - A p0): of any length, on the side of counter-clockwise winding in world space.
  [[nodiscard]] const Certified3& normal() const { return normal_; }

 private:
  [[nodiscard]] Certified height(const Certified3& p) const;

  Mat3d linear_;
  Certified3 translation_;
  Certified3 corner_;  ///< A p0
  Certified3 normal_;
};

}  // namespace gridcast::scene
