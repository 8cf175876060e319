// How far the object-space ray of exact mode is from the true image of the world ray, against rationals.

#include "core/mesh/exact_ray.h"

#include <gtest/gtest.h>

#include "tests/support/hostile.h"
#include "tests/support/rational.h"

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

// Squeezed to 2^-90 of its length along one line, which no axis shows, an instance leaves of a ray in the
// plane that stays an image good to some 2^-16.
TEST(ExactImage, is_within_its_drift_where_newtons_iteration_has_nothing_left_to_gain) {
  test::Random random(test::seed_or(5202));
  std::size_t close = 0;
  for (int i = 0; i < 500; ++i) {
    const Vec3d along{1.0 + random.uniform(), random.uniform(), 0.0};
    const Vec3d squeezed = std::exp2(-random.uniform(60.0, 95.0)) * Vec3d(-along.y, along.x, 0.0);
    const InstanceTransform transform({Mat3d(along, squeezed, Vec3d(0, 0, 1)), Vec3d(0.0)});
    if (!transform.active()) continue;
    const auto whole = [&] { return double(1 << random.below(4)); };
    const Ray ray{-whole() * along - Vec3d(0, 0, whole()), whole() * along};
    const Bounds3f bounds{Vec3f(-1.F), Vec3f(1.F)};
    close += std::size_t(exact_image(ray, transform, bounds).is_close);
    expect_within_drift(ray, transform, bounds);
  }
  EXPECT_GT(close, 100U);
}

}  // namespace
}  // namespace gridcast::mesh
