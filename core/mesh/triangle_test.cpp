#include "core/mesh/triangle_test.h"

namespace gridcast::mesh::detail {

// The order of the axes is cyclic, so the determinants are those of the axes x, y, z.
Sides exact_sides(const ObjectRay& ray, const AxesTriangle& triangle) {
  const Vec3d d{component(ray.direction, ray.kx), component(ray.direction, ray.ky), ray.direction_z};
  const Vec3d& o = ray.axes_origin;
  const Vec3d a(triangle.p0);
  const Vec3d b(triangle.p1);
  const Vec3d c(triangle.p2);
  return {exact_side(d, o, c, b), exact_side(d, o, a, c), exact_side(d, o, b, a)};
}

}  // namespace gridcast::mesh::detail
