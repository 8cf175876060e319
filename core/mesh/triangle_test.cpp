#include "core/mesh/triangle_test.h"

#include <algorithm>

namespace gridcast::mesh::detail {
namespace {

// 113 bits hold every product below exactly for coordinates that span up to 2^20 of scale.
#ifdef __SIZEOF_FLOAT128__
__extension__ using Quad = __float128;
#else
using Quad = long double;
#endif

}  // namespace

bool is_edge_on(const Vec3d& direction, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2) {
  Quad e1[3];
  Quad e2[3];
  for (int axis = 0; axis < 3; ++axis) {
    e1[axis] = Quad(p1[axis]) - Quad(p0[axis]);
    e2[axis] = Quad(p2[axis]) - Quad(p0[axis]);
  }
  const Quad volume = (e1[1] * e2[2] - e1[2] * e2[1]) * Quad(direction.x) +
                      (e1[2] * e2[0] - e1[0] * e2[2]) * Quad(direction.y) +
                      (e1[0] * e2[1] - e1[1] * e2[0]) * Quad(direction.z);
  return volume == Quad(0);
}

bool finish_robust(const ObjectRay& ray, const Vec3d sheared[3], const Vec3f& p0, const Vec3f& p1,
                   const Vec3f& p2, TriangleHit& hit) {
  const Vec3d& a = sheared[0];
  const Vec3d& b = sheared[1];
  const Vec3d& c = sheared[2];
  const double u = difference_of_products(c.x, b.y, c.y, b.x);
  const double v = difference_of_products(a.x, c.y, a.y, c.x);
  const double w = difference_of_products(b.x, a.y, b.y, a.x);
  if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) return false;
  const double determinant = u + v + w;
  if (determinant == 0.0) return false;

  // The sheared points carry errors of a few 2^-53 of `size`, so an area below this may stand for 0.
  const double size = std::max({max_abs(a), max_abs(b), max_abs(c)});
  if (std::abs(determinant) <= 0x1p-45 * size * size && is_edge_on(ray.direction, p0, p1, p2)) return false;

  // Depth relative to one vertex: exact when all three depths agree, accurate when they are close.
  const double z = a.z + (v * (b.z - a.z) + w * (c.z - a.z)) / determinant;
  const auto [nearest, farthest] = std::minmax({a.z, b.z, c.z});
  hit = {std::clamp(z, nearest, farthest) / ray.direction[ray.kz], v / determinant, w / determinant};
  return true;
}

}  // namespace gridcast::mesh::detail
