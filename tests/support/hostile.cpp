#include "tests/support/hostile.h"

namespace gridcast::test {
namespace {

double power_of_ten(Random& random, double low, double high) {
  return std::pow(10.0, random.uniform(low, high));
}

/// Every coordinate of its own size: pbrt's pExp.
std::array<Vec3f, 3> of_all_sizes(Random& random) {
  std::array<Vec3f, 3> corners;
  for (Vec3f& p : corners)
    for (int axis = 0; axis < 3; ++axis)
      p[axis] = float(power_of_ten(random, -8.0, 8.0) * (random.below(2) == 0 ? -1.0 : 1.0));
  return corners;
}

std::array<Vec3f, 3> sliver(Random& random, double aspect) {
  const Vec3d along = random.direction();
  const Vec3d across = random.direction() / aspect;
  const Vec3d first = random.in_box(1.0);
  return {Vec3f(first), Vec3f(first + along), Vec3f(first + random.uniform() * along + across)};
}

std::array<Vec3f, 3> any_corners(Random& random) {
  switch (random.below(4)) {
    case 0:
      return of_all_sizes(random);
    case 1:
      return sliver(random, power_of_ten(random, 1.0, 8.0));
    default:
      break;
  }
  std::array<Vec3f, 3> corners = sliver(random, 1.0);
  constexpr double kOffsets[] = {0.0, 1.0, 1e3, 1e6};
  const Vec3f offset(kOffsets[random.below(4)] * random.direction());
  for (Vec3f& p : corners) p += offset;
  return corners;
}

Affine any_placement(Random& random) {
  Affine placed;
  constexpr double kOffsets[] = {0.0, 1e3, 1e6, 1e9, 1e12};
  placed.translation = kOffsets[random.below(5)] * random.in_box(1.0);
  if (random.below(3) == 0) return placed;
  const double scale = power_of_ten(random, -6.0, 6.0);
  for (int axis = 0; axis < 3; ++axis) placed.linear[axis] = scale * random.direction();
  // Nearly flat: the third column almost in the plane of the others.
  if (random.below(4) == 0) {
    const double flat = power_of_ten(random, -10.0, -1.0);
    placed.linear[2] = 0.3 * placed.linear[0] - 0.7 * placed.linear[1] + flat * placed.linear[2];
  }
  return placed;
}

bool has_area(const std::array<Vec3f, 3>& p) {
  return max_abs(glm::cross(Vec3d(p[1]) - Vec3d(p[0]), Vec3d(p[2]) - Vec3d(p[0]))) > 0.0;
}

}  // namespace

Vec3d HostileTriangle::point(double u, double v) const {
  return transform.world_from_object().point((1.0 - u - v) * Vec3d(corners[0]) + u * Vec3d(corners[1]) +
                                             v * Vec3d(corners[2]));
}

HostileTriangle hostile_triangle(Random& random) {
  for (;;) {
    const HostileTriangle triangle{any_corners(random), InstanceTransform(any_placement(random))};
    if (triangle.transform.active() && has_area(triangle.corners)) return triangle;
  }
}

Ray hostile_ray(const HostileTriangle& triangle, Random& random) {
  const Vec3d p0 = triangle.point(0.0, 0.0);
  const Vec3d a = triangle.point(1.0, 0.0) - p0, b = triangle.point(0.0, 1.0) - p0;
  // Far from the world's origin a small triangle is a point of doubles: step back by more than their spacing.
  const double size = std::max({max_abs(a), max_abs(b), 0x1p-44 * max_abs(p0), 0x1p-100});
  for (;;) {
    double u = random.uniform(), v = random.uniform();
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    if (random.below(6) == 0) v = 0.0;
    if (random.below(12) == 0) u = v = 0.0;
    const Vec3d target = triangle.point(u, v);
    Vec3d direction = random.direction();
    if (random.below(3) == 0) {
      const Vec3d in_plane = random.uniform(-1.0, 1.0) * (a / size) + random.uniform(-1.0, 1.0) * (b / size);
      direction = in_plane + power_of_ten(random, -9.0, -1.0) * direction;
    }
    const Vec3d away = size * power_of_ten(random, -6.0, 6.0) * direction;
    const Ray ray{target - away, power_of_ten(random, -6.0, 6.0) * (target - (target - away))};
    if (is_valid(ray)) return ray;
  }
}

}  // namespace gridcast::test
