#pragma once

#include <array>

#include "core/math/affine.h"
#include "core/math/dyadic.h"
#include "core/math/ray.h"

namespace gridcast::mesh {

/// A triangle of an instance in the real-number problem that the stored numbers pose: corners A p + T, a ray
/// o + t d in world space, nothing rounded. With a, b, c the corners less o:
///   sides  u = d . (c x b), v = d . (a x c), w = d . (b x a)   (as in triangle_test.h)
///   t = depth / determinant,  determinant = u + v + w,  depth = a . (c x b)
///
/// Room in a Dyadic: the limits of affine.h, ray.h and triangle_mesh.h put a coordinate of a corner between
/// 2^-1223 and 2^163 (23 limbs), a direction's between 2^-1074 and 2^200 (21), so cross products take 47,
/// sides and determinant 69, depth 71, and depth times another's determinant 140 limbs.
struct ExactTriangle {
  Dyadic u, v, w;
  Dyadic determinant, depth;

  ExactTriangle(const Ray& ray, const Affine& world_from_object, const std::array<Vec3f, 3>& corners);
  /// For a ray that is given in object space.
  ExactTriangle(const Ray& ray, const std::array<Vec3f, 3>& corners);

  /// Whether the ray's line meets the closed triangle: not where it has no area or the line lies in its
  /// plane.
  [[nodiscard]] bool hit() const;
  /// The sign of t - limit, of a triangle whose determinant is not 0. `limit` is not NaN.
  [[nodiscard]] int compare_t(double limit) const;
  /// The sign of t - other.t.
  [[nodiscard]] int compare_t(const ExactTriangle& other) const;
  /// t within Dyadic::kQuotientError of itself.
  [[nodiscard]] double t() const { return quotient(depth, determinant); }

 private:
  using Point = std::array<Dyadic, 3>;
  void set(const Vec3d& direction, const Point& a, const Point& b, const Point& c);
};

}  // namespace gridcast::mesh
