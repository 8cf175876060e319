// How far the object-space ray of exact mode is from the true image of the world ray, against rationals.

#include "core/mesh/exact_ray.h"

#include <gtest/gtest.h>

#include "tests/support/hostile.h"
#include "tests/support/rational.h"
#include "tests/support/squeezed.h"

namespace gridcast::mesh {
namespace {

using test::cross;
using test::dot;
using test::operator-;

/// A^-1 y by G. Cramer's rule.
test::Rational3 solved(const Mat3d& a, const test::Rational3& y) {
  const test::Rational3 x = test::rational(a[0]), b = test::rational(a[1]), c = test::rational(a[2]);
  const test::Rational determinant = dot(x, cross(b, c));
  return {dot(y, cross(b, c)) / determinant, dot(y, cross(c, x)) / determinant,
          dot(y, cross(x, b)) / determinant};
}

/// The largest distance of the two rays per axis at this t.
test::Rational apart(const ExactImage& image, const test::Rational3& o, const test::Rational3& d, double t) {
  test::Rational most = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = std::size_t(axis);
    const test::Rational off = (o[i] - test::Rational(image.origin[axis])) +
                               test::Rational(t) * (d[i] - test::Rational(image.direction[axis]));
    most = std::max(most, test::Rational(abs(off)));
  }
  return most;
}

void expect_within_drift(const Ray& ray, const InstanceTransform& transform, const Bounds3f& bounds) {
  const ExactImage image = exact_image(ray, transform, bounds);
  if (!image.is_close) return;
  const Affine& placed = transform.world_from_object();
  const test::Rational3 o =
      solved(placed.linear, test::rational(ray.origin) - test::rational(placed.translation));
  const test::Rational3 d = solved(placed.linear, test::rational(ray.direction));
  // A hit lies in the mesh, so at most this far along.
  const double last = (max_abs(image.origin) + double(bounds.magnitude())) / max_abs(image.direction);
  for (const double t : {-last, 0.0, last}) {
    const test::Rational off = apart(image, o, d, t);
    EXPECT_LE(off, test::Rational(image.drift));
    EXPECT_TRUE(!image.is_image || off == 0);
  }
}

TEST(ExactImage, is_within_its_drift_of_the_true_one) {
  test::Random random(test::seed_or(5201));
  for (int i = 0; i < 2000; ++i) {
    const test::HostileTriangle triangle = test::hostile_triangle(random);
    Bounds3f bounds;
    for (const Vec3f& corner : triangle.corners) bounds.extend(corner);
    expect_within_drift(test::hostile_ray(triangle, random), triangle.transform, bounds);
  }
}

TEST(ExactImage, is_within_its_drift_where_newtons_iteration_has_nothing_left_to_gain) {
  test::Random random(test::seed_or(5202));
  std::size_t close = 0;
  for (int i = 0; i < 500; ++i) {
    const test::SqueezedPlane plane(random);
    const InstanceTransform transform(plane.world_from_object());
    const Ray ray = plane.ray_to(1 + int(3 * random.below(3)), int(random.below(3)), double(random.below(3)));
    const Bounds3f bounds{Vec3f(-1.F), Vec3f(1.F)};
    close += std::size_t(exact_image(ray, transform, bounds).is_close);
    expect_within_drift(ray, transform, bounds);
  }
  EXPECT_GT(close, 400U);
}

}  // namespace
}  // namespace gridcast::mesh
