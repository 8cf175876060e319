// The t of exact mode against rationals.

#include "core/scene/exact_t.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/hostile.h"
#include "tests/support/rational.h"

namespace gridcast::scene {
namespace {

/// Weights of the point where the ray meets the plane, in doubles, and t a few roundings beside.
Hit near_hit(const test::HostileTriangle& triangle, const Ray& ray, double t, test::Random& random) {
  const Vec3d p = triangle.transform.point_to_object(ray.origin + t * ray.direction);
  const Vec3d a(triangle.corners[0]), e1 = Vec3d(triangle.corners[1]) - a,
                                      e2 = Vec3d(triangle.corners[2]) - a;
  const Vec3d n = glm::cross(e1, e2);
  const double area = glm::dot(n, n);
  Hit hit;
  hit.t = t * (1.0 + 0x1p-52 * std::floor(random.uniform(-8.0, 9.0)));
  hit.u = glm::dot(n, glm::cross(p - a, e2)) / area;
  hit.v = glm::dot(n, glm::cross(e1, p - a)) / area;
  return hit;
}

TEST(ExactT, is_within_a_rounding_of_the_true_one_and_nearly_always_the_nearest_double) {
  test::Random random(test::seed_or(5204));
  std::size_t asked = 0, nearest = 0;
  for (int i = 0; i < 4000; ++i) {
    const test::HostileTriangle triangle = test::hostile_triangle(random);
    const Ray ray = test::hostile_ray(triangle, random);
    const Affine& placed = triangle.transform.world_from_object();
    const test::RationalPlane plane(placed, triangle.corners);
    if (plane.slope(ray) == 0) continue;
    const test::Rational truth = plane.t_of(ray);
    const double t = exact_t(ray, placed, triangle.corners, near_hit(triangle, ray, truth.get_d(), random));
    const test::Rational off = abs(test::Rational(t) - truth);
    ASSERT_LE(off, test::Rational(0x1p-52) * abs(truth)) << "triangle " << i;
    ++asked;
    const auto beside = [&](double way) {
      return test::Rational(abs(test::Rational(std::nextafter(t, way)) - truth));
    };
    nearest += std::size_t(off <= beside(1e300) && off <= beside(-1e300));
  }
  EXPECT_GT(asked, 3500U);
  EXPECT_GT(nearest, asked - asked / 100);
}

}  // namespace
}  // namespace gridcast::scene
