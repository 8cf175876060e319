#include "core/math/affine.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace gridcast {
namespace {

using Wide = long double;  // 11 more bits: enough to judge the rounding of double

Mat3d random_linear(test::Random& random) {
  Mat3d m;
  for (int c = 0; c < 3; ++c) m[c] = random.in_box(1.0) * std::exp2(random.uniform(-6.0, 6.0));
  return m;
}

TEST(AffineBounds, the_world_box_holds_the_exact_image_of_every_corner) {
  test::Random random(test::seed_or(51));
  for (int i = 0; i < 20000; ++i) {
    const double offset = random.below(2) == 0 ? 1.0 : 1e6;
    const InstanceTransform transform(Affine{random_linear(random), random.in_box(offset)});
    if (!transform.active()) continue;
    Bounds3f box;
    box.extend(Vec3f(random.in_box(10.0)));
    box.extend(Vec3f(random.in_box(10.0)));
    const Bounds3d world = transform.bounds_to_world(box);
    const Mat3d& m = transform.world_from_object().linear;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3f p{(corner & 1) != 0 ? box.upper.x : box.lower.x,
                    (corner & 2) != 0 ? box.upper.y : box.lower.y,
                    (corner & 4) != 0 ? box.upper.z : box.lower.z};
      for (int axis = 0; axis < 3; ++axis) {
        Wide image = transform.world_from_object().translation[axis];
        for (int c = 0; c < 3; ++c) image += Wide(m[c][axis]) * Wide(p[c]);
        EXPECT_GE(image, Wide(world.lower[axis]));
        EXPECT_LE(image, Wide(world.upper[axis]));
      }
    }
  }
}

TEST(AffineBounds, empty_stays_empty) {
  EXPECT_TRUE(InstanceTransform(Affine{Mat3d(2.0), Vec3d(5.0)}).bounds_to_world({}).empty());
}

TEST(AffineInverse, round_trips_stay_within_the_measured_error) {
  test::Random random(test::seed_or(52));
  for (int i = 0; i < 20000; ++i) {
    Mat3d linear = random_linear(random);
    // Now and then nearly singular.
    if (i % 3 == 0)
      linear[2] = linear[0] + linear[1] + std::exp2(-random.uniform(5.0, 35.0)) * random.in_box(1.0);
    const InstanceTransform transform(Affine{linear, Vec3d(0.0)});
    if (!transform.active()) continue;
    const Vec3d v = random.in_box(3.0);
    const Vec3d object = transform.vector_to_object(v);
    Wide error = 0.0L;
    for (int axis = 0; axis < 3; ++axis) {
      Wide back = -Wide(v[axis]);
      for (int c = 0; c < 3; ++c) back += Wide(linear[c][axis]) * Wide(object[c]);
      error = std::max(error, back < 0 ? -back : back);
    }
    EXPECT_LE(error, Wide(transform.round_trip_error()) * Wide(max_abs(v)));
  }
}

TEST(AffineInverse, tiny_and_huge_scales_are_exact_for_powers_of_two) {
  for (const int exponent : {-100, -40, 0, 40, 100}) {
    const double scale = std::ldexp(1.0, exponent);
    const InstanceTransform transform(Affine{Mat3d(scale), Vec3d(7.0)});
    ASSERT_TRUE(transform.active());
    EXPECT_EQ(transform.vector_to_object(Vec3d(scale, 0, -scale)), Vec3d(1, 0, -1));
    EXPECT_EQ(transform.point_to_object(Vec3d(7.0)), Vec3d(0.0));
    EXPECT_EQ(transform.condition(), 1.0);
  }
}

TEST(AffineInverse, singular_non_finite_and_out_of_range_transforms_are_inactive) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const Affine bad[] = {
      {Mat3d(0.0), Vec3d(0.0)},
      {Mat3d(1, 0, 0, 0, 1, 0, 0, 0, 0), Vec3d(0.0)},
      {Mat3d(1, 2, 3, 2, 4, 6, 0, 0, 1), Vec3d(0.0)},
      {Mat3d(nan), Vec3d(0.0)},
      {Mat3d(1.0), Vec3d(0, nan, 0)},
      {Mat3d(1.0), Vec3d(inf, 0, 0)},
      {Mat3d(1.0), Vec3d(nan, 1, 2)},
      {Mat3d(0x1p101), Vec3d(0.0)},
      {Mat3d(0x1p-101), Vec3d(0.0)},
      {Mat3d(1, 1, 0, 1, 1 + 0x1p-50, 0, 0, 0, 1), Vec3d(0.0)},
  };
  for (const Affine& affine : bad) EXPECT_FALSE(InstanceTransform(affine).active());
  EXPECT_TRUE(InstanceTransform(Affine{}).active());
}

TEST(AffineCondition, grows_with_shear_and_not_with_uniform_scale) {
  const auto condition = [](const Mat3d& m) { return InstanceTransform(Affine{m, {}}).condition(); };
  EXPECT_EQ(condition(Mat3d(3.0)), condition(Mat3d(1.0)));
  EXPECT_GT(condition(Mat3d(1, 0, 0, 100, 1, 0, 0, 0, 1)), 100.0);
}

TEST(AffineNormal, is_perpendicular_to_the_image_of_the_surface_under_any_transform) {
  test::Random random(test::seed_or(53));
  for (int i = 0; i < 5000; ++i) {
    const InstanceTransform transform(Affine{random_linear(random), random.in_box(10.0)});
    if (!transform.active() || transform.condition() > 1e4) continue;
    const Vec3d a = random.direction(), b = random.direction();
    const Vec3d normal = transform.normal_to_world(glm::cross(a, b));
    EXPECT_NEAR(glm::length(normal), 1.0, 1e-14);
    EXPECT_NEAR(glm::dot(normal, glm::normalize(transform.world_from_object().vector(a))), 0.0, 1e-8);
    EXPECT_NEAR(glm::dot(normal, glm::normalize(transform.world_from_object().vector(b))), 0.0, 1e-8);
  }
}

TEST(AffineNormal, a_mirror_keeps_the_side_of_the_winding_and_sizes_do_not_matter) {
  const InstanceTransform mirror(Affine{Mat3d(-1, 0, 0, 0, 1, 0, 0, 0, 1), Vec3d(0.0)});
  EXPECT_EQ(mirror.normal_to_world(Vec3d(0, 0, 2)), Vec3d(0, 0, 1));
  EXPECT_EQ(mirror.normal_to_world(Vec3d(1, 0, 0)), Vec3d(-1, 0, 0));
  for (const double scale : {kMinScale, 1.0, kMaxScale}) {
    const InstanceTransform scaled(Affine{Mat3d(scale), Vec3d(0.0)});
    const InstanceTransform flat(Affine{Mat3d(scale, 0, 0, 0, scale, 0, 0, 0, 0x1p-42 * scale), Vec3d(0.0)});
    for (const double size : {0x1p-300, 1.0, 0x1p300}) {
      EXPECT_EQ(scaled.normal_to_world(Vec3d(0, size, 0)), Vec3d(0, 1, 0));
      EXPECT_EQ(flat.normal_to_world(Vec3d(0, 0, -size)), Vec3d(0, 0, -1));
      EXPECT_NEAR(flat.normal_to_world(Vec3d(size, size, 0)).x, std::sqrt(0.5), 1e-15);
    }
  }
}

// It was of condition 1, its normals were zero, and rays left the range of the exact arithmetic.
TEST(AffineNormal, what_is_flattened_beyond_the_range_of_rays_is_not_active) {
  for (int axis = 0; axis < 3; ++axis)
    for (const double scale : {0x1p-142, 0x1p-144, 1e-200, 1e-308}) {
      Mat3d linear(1.0);
      linear[axis][axis] = scale;
      const InstanceTransform transform(Affine{linear, Vec3d(1.0)});
      ASSERT_EQ(transform.active(), scale == 0x1p-142) << scale;
      if (!transform.active()) continue;
      for (const double size : {0x1p-300, 1.0, 0x1p300}) {
        const Vec3d normal = transform.normal_to_world(Vec3d(size));
        EXPECT_NEAR(glm::length(normal), 1.0, 1e-15);
        EXPECT_NEAR(normal[axis], 1.0, 1e-15);
      }
    }
}

}  // namespace
}  // namespace gridcast
