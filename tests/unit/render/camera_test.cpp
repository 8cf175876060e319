#include "core/render/camera.h"

#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace gridcast::render {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

scene::Camera camera_at_z5(double yfov_rad = 0.5 * kPi) {
  return look_at({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, yfov_rad).value();
}

void expect_near(const Vec3d& a, const Vec3d& b, double bound = 1e-14) {
  EXPECT_LT(max_abs(a - b), bound) << a.x << ' ' << a.y << ' ' << a.z;
}

TEST(LookAt, the_middle_of_the_picture_is_the_target) {
  const Vec3d eye(3, -2, 7), target(-1, 4, 0.5);
  const scene::Camera camera = look_at(eye, target, {0, 1, 0}, 0.7).value();
  const Ray ray = primary_ray(camera, 101, 57, 50.5, 28.5);
  expect_near(ray.origin, eye);
  expect_near(ray.direction, glm::normalize(target - eye));
  EXPECT_TRUE(is_usable(camera));
}

TEST(LookAt, bad_arguments_are_named) {
  const Vec3d eye(0, 0, 5), target(0), up(0, 1, 0);
  EXPECT_EQ(look_at({kNan, 0, 0}, target, up, 1.0).error().where, "/eye");
  EXPECT_EQ(look_at(eye, {0, kNan, 0}, up, 1.0).error().where, "/target");
  EXPECT_EQ(look_at(eye, eye, up, 1.0).error().where, "/target");
  EXPECT_EQ(look_at(eye, target, {0, 0, 0}, 1.0).error().where, "/up");
  EXPECT_EQ(look_at(eye, target, {0, 0, -3}, 1.0).error().where, "/up");
  EXPECT_EQ(look_at(eye, target, up, 0.0).error().where, "/yfov_rad");
  EXPECT_EQ(look_at(eye, target, up, kPi).error().where, "/yfov_rad");
  EXPECT_EQ(look_at(eye, target, up, kNan).error().where, "/yfov_rad");
}

TEST(LookAt, far_and_near_targets_do_not_overflow) {
  for (const double distance : {1e-150, 1e-30, 1e30, 1e150}) {
    const auto camera = look_at({0, 0, distance}, {0, 0, 0}, {0, distance, 0}, 1.0);
    ASSERT_TRUE(camera.ok()) << distance;
    expect_near(primary_ray(*camera, 3, 3, 1.5, 1.5).direction, {0, 0, -1});
  }
}

TEST(PrimaryRay, corners_span_the_field_of_view_and_the_first_row_is_up) {
  const scene::Camera camera = camera_at_z5();
  expect_near(primary_ray(camera, 200, 100, 0, 0).direction, glm::normalize(Vec3d(-2, 1, -1)));
  expect_near(primary_ray(camera, 200, 100, 200, 100).direction, glm::normalize(Vec3d(2, -1, -1)));
  expect_near(primary_ray(camera, 200, 100, 100, 0).direction, glm::normalize(Vec3d(0, 1, -1)));
}

TEST(PrimaryRay, a_camera_of_its_own_shape_is_shown_whole_with_square_pixels) {
  scene::Camera camera = camera_at_z5();
  camera.aspect_ratio = 2.0;
  // In a square picture the width decides, in a wide one the height.
  expect_near(primary_ray(camera, 100, 100, 0, 0).direction, glm::normalize(Vec3d(-2, 2, -1)));
  expect_near(primary_ray(camera, 400, 100, 0, 0).direction, glm::normalize(Vec3d(-4, 1, -1)));
}

TEST(PrimaryRay, orthographic_rays_are_parallel_and_start_on_the_camera_plane) {
  scene::Camera camera = camera_at_z5();
  camera.kind = scene::CameraKind::kOrthographic;
  camera.xmag = 3.0;
  camera.ymag = 1.5;
  const Ray first = primary_ray(camera, 200, 100, 0, 0), last = primary_ray(camera, 200, 100, 200, 100);
  expect_near(first.origin, {-3, 1.5, 5});
  expect_near(last.origin, {3, -1.5, 5});
  expect_near(first.direction, {0, 0, -1});
  EXPECT_EQ(first.direction, last.direction);
}

TEST(PrimaryRay, directions_have_unit_length) {
  test::Random random(test::seed_or(21));
  for (int i = 0; i < 100; ++i) {
    const Vec3d eye = random.in_box(10.0);
    const scene::Camera camera =
        look_at(eye, eye + random.direction(), random.direction(), random.uniform(0.01, 3.0)).value();
    const Ray ray = primary_ray(camera, 64, 48, random.uniform(0, 64), random.uniform(0, 48));
    EXPECT_NEAR(glm::length(ray.direction), 1.0, 1e-15);
    EXPECT_TRUE(is_valid(ray));
  }
}

// Picture coordinates, -1 to 1 on both axes, of a point as the camera sees it.
glm::dvec2 project(const scene::Camera& camera, double aspect, const Vec3d& p) {
  const Affine& place = camera.world_from_camera;
  const Vec3d local = glm::transpose(place.linear) * (p - place.translation);
  EXPECT_LT(local.z, 0.0);
  const double tangent = std::tan(0.5 * camera.yfov_rad);
  return {local.x / (-local.z * tangent * aspect), local.y / (-local.z * tangent)};
}

TEST(Frame, every_corner_is_in_the_picture_and_one_is_near_its_edge) {
  test::Random random(test::seed_or(22));
  for (int i = 0; i < 200; ++i) {
    Bounds3d box;
    const double scale = std::pow(10.0, random.uniform(-6.0, 6.0));
    box.extend(scale * random.in_box(1.0) + Vec3d(scale));
    box.extend(scale * random.in_box(1.0) + Vec3d(scale));
    const double aspect = random.uniform(0.3, 3.0);
    const scene::Camera camera = frame(box, random.uniform(0.2, 1.5), aspect);
    double farthest = 0.0;
    for (int c = 0; c < 8; ++c) {
      const Vec3d corner((c & 1) != 0 ? box.lower.x : box.upper.x, (c & 2) != 0 ? box.lower.y : box.upper.y,
                         (c & 4) != 0 ? box.lower.z : box.upper.z);
      const glm::dvec2 p = project(camera, aspect, corner);
      farthest = std::max({farthest, std::abs(p.x), std::abs(p.y)});
    }
    EXPECT_LE(farthest, 1.0);
    EXPECT_GE(farthest, 0.9);
  }
}

TEST(Frame, boxes_without_a_size_give_usable_cameras) {
  EXPECT_TRUE(is_usable(frame({}, 0.8, 1.5)));
  EXPECT_TRUE(is_usable(frame({Vec3d(7.0), Vec3d(7.0)}, 0.8, 1.5)));
  EXPECT_TRUE(is_usable(frame({Vec3d(0.0), Vec3d(1.0)}, kNan, -1.0)));
}

TEST(IsUsable, refuses_what_would_make_invalid_rays) {
  scene::Camera camera = camera_at_z5();
  camera.world_from_camera.translation.x = kNan;
  EXPECT_FALSE(is_usable(camera));
  camera = camera_at_z5();
  camera.world_from_camera.linear = Mat3d(0.0);
  EXPECT_FALSE(is_usable(camera));
  camera = camera_at_z5();
  camera.yfov_rad = 0.0;
  EXPECT_FALSE(is_usable(camera));
  camera = camera_at_z5();
  camera.kind = scene::CameraKind::kOrthographic;
  camera.xmag = 0.0;
  EXPECT_FALSE(is_usable(camera));
}

}  // namespace
}  // namespace gridcast::render
