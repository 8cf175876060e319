#pragma once
// A placed triangle in extended precision, and what robust mode may get wrong about it in the world.

#include <array>

#include "core/math/affine.h"
#include "core/math/hit.h"
#include "core/math/ray.h"

namespace gridcast::stability {

using Wide = long double;
using Wide3 = glm::tvec3<Wide>;

/// Robust mode decides without error about the object-space ray (o', d'), whose image in the world is off by
/// |A o' + T - o| <= e |o - T| and |A d' - d| <= e |d| on every axis (core/math/affine.h). Turn the true ray
/// into that image: where a hit comes or goes, the turning ray meets the border of the triangle. So the true
/// ray passes the border closer than e (|o - T| + |border - o|), or its hit is at an end of the
/// range, as far as t may be off.
class WorldTriangle {
 public:
  WorldTriangle(const InstanceTransform& transform, const std::array<Vec3f, 3>& corners);

  /// Whether the way to object space, or the rounding of t, can decide if the ray hits the triangle. `t` is
  /// that of the hit.
  [[nodiscard]] bool is_undecided(const Ray& ray, double t, double mesh_size) const;

  /// The distance of o + t d from the plane of a robust hit, over what it may be: the turn of the ray and the
  /// containment of core/README.md, 2^-49 (|o'| + |mesh|) in object space, across the plane. `t_off` is how
  /// far t is from the true one.
  [[nodiscard]] double height_share(const Ray& ray, double t, double t_off, double mesh_size) const;

  /// The sine of the angle to the true normal, over what it may be: 3 sqrt(3) e for the stored inverse, and
  /// 2^-50 of what the sums of the normal are made of. Infinite on the wrong side. 0 where the bound says
  /// nothing, as for slivers whose area is lost to rounding.
  [[nodiscard]] double normal_share(const Vec3d& normal) const;

  /// How many roundings of |A||B| the stored inverse B is off by, the largest row sum of |A B - I| over 2^-53
  /// times that of |A||B|. All of the above allows for whatever it is.
  [[nodiscard]] double inverse_roundings() const { return inverse_roundings_; }

 private:
  /// Whether the object-space ray is the world ray itself, so that nothing is turned.
  [[nodiscard]] bool is_image(const Ray& ray) const;
  /// How far the turned ray may be from the true one, `reach` from the origin.
  [[nodiscard]] Wide turn(const Ray& ray, Wide reach) const;

  const InstanceTransform& transform_;
  std::array<Wide3, 3> corners_;  ///< in the world
  Wide3 image_;                   ///< of the normal, by the matrix of cofactors, on the side of the winding
  Wide sums_;                     ///< its largest component with every sum made of absolute values
  Wide object_normal_ = 0;        ///< length of the normal in object space
  Wide determinant_;
  Wide round_trip_ = 0;  ///< e
  double inverse_roundings_ = 0.0;
};

}  // namespace gridcast::stability
