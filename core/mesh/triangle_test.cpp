#include "core/mesh/triangle_test.h"

#include <algorithm>

#include "core/math/exact.h"

namespace gridcast::mesh::detail {
namespace {

/// Edge functions: twice the areas that the ray cuts off, u opposite p0, v opposite p1, w opposite p2.
struct Sides {
  double u, v, w;
  [[nodiscard]] bool mixed() const { return std::min({u, v, w}) < 0.0 && std::max({u, v, w}) > 0.0; }
  [[nodiscard]] double smallest() const { return std::min({std::abs(u), std::abs(v), std::abs(w)}); }
};

/// Accurate for the sheared points as they are rounded.
Sides rounded_sides(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  return {difference_of_products(c.x, b.y, c.y, b.x), difference_of_products(a.x, c.y, a.y, c.x),
          difference_of_products(b.x, a.y, b.y, a.x)};
}

/// Accurate for the ray and the triangle as given; the scale differs from rounded_sides by direction[kz].
Sides exact_sides(const ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2) {
  const Vec3d a(p0);
  const Vec3d b(p1);
  const Vec3d c(p2);
  return {exact_side(ray.direction, ray.origin, c, b), exact_side(ray.direction, ray.origin, a, c),
          exact_side(ray.direction, ray.origin, b, a)};
}

}  // namespace

// Rounding of an edge function. With unit roundoff r = 2^-53 and D = ray.distance >= |p - o| per axis, a
// sheared coordinate (two subtractions, a product, a shear of at most 1 off by 2 r) is off by at most 7 r D <
// e = 2^-50 D. The products then add at most 4 r m^2, with m the largest sheared coordinate, m <= 2 D.
// Together
//   |error| <= 4 e m + 2 e^2 + 4 r m^2 < 8 e (m + e),
// and with m <= 2 D that is below 2^-45 D^2 = ray.side_error.
bool finish_robust(const ObjectRay& ray, const std::array<Vec3d, 3>& sheared, const Vec3f& p0,
                   const Vec3f& p1, const Vec3f& p2, TriangleHit& hit) {
  const auto& [a, b, c] = sheared;
  Sides sides = rounded_sides(a, b, c);
  const double m =
      std::max({std::abs(a.x), std::abs(a.y), std::abs(b.x), std::abs(b.y), std::abs(c.x), std::abs(c.y)});
  const double e = 0x1p-50 * ray.distance;
  if (sides.smallest() <= 8.0 * e * (m + e)) sides = exact_sides(ray, p0, p1, p2);
  if (sides.mixed()) return false;
  // All of one sign or 0: the sum is 0 only when all are, for a ray in the triangle's plane or a triangle
  // that it sees as a point. A triangle without area never comes here with sides of one sign.
  const double determinant = sides.u + sides.v + sides.w;
  if (determinant == 0.0) return false;

  // Depth relative to one vertex: exact when all three depths agree, accurate when they are close.
  const double z = a.z + (sides.v * (b.z - a.z) + sides.w * (c.z - a.z)) / determinant;
  const double nearest = std::min({a.z, b.z, c.z});
  const double farthest = std::max({a.z, b.z, c.z});
  hit = {std::clamp(z, nearest, farthest) / ray.direction[ray.kz], sides.v / determinant,
         sides.w / determinant};
  return true;
}

}  // namespace gridcast::mesh::detail
