// Rays of sensors against the definitions of their models.

#include "core/sensor/pattern.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/render/camera.h"
#include "core/sensor/noise.h"
#include "tests/support/random.h"

namespace gridcast::sensor {
namespace {

constexpr double kPi = std::numbers::pi;

Affine tilted() {
  return render::look_at({3, 2, 4}, {0, 1, -1}, {0.1, 1, 0}, 0.8)->world_from_camera;
}
/// A ray as the sensor sees it.
Ray local(const Sensor& sensor, std::size_t i) {
  const Ray world = ray(sensor, i);
  const Mat3d back = glm::transpose(sensor.world_from_sensor.linear);
  return {back * (world.origin - sensor.world_from_sensor.translation), back * world.direction, world.tnear,
          world.tfar};
}

TEST(Pattern, cameras_give_the_primary_rays_of_pictures) {
  const Sensor pinhole{tilted(), Pinhole{8, 6, 0.9}, 50.0};
  ASSERT_EQ(ray_count(pinhole), 48U);
  auto camera = *render::look_at({3, 2, 4}, {0, 1, -1}, {0.1, 1, 0}, 0.9);
  const Sensor flat{tilted(), Orthographic{8, 6, 3.0}};
  for (std::size_t i = 0; i < 48; ++i) {
    const Ray picture = render::primary_ray(camera, 8, 6, double(i % 8) + 0.5, double(i / 8) + 0.5);
    EXPECT_EQ(ray(pinhole, i).direction, picture.direction);
    EXPECT_EQ(ray(pinhole, i).origin, picture.origin);
    EXPECT_EQ(ray(pinhole, i).tfar, 50.0);
    const Ray parallel = local(flat, i);
    EXPECT_NEAR(parallel.origin.x, 0.5 * (double(i % 8) - 3.5), 1e-12);
    EXPECT_NEAR(parallel.origin.y, 0.5 * (2.5 - double(i / 8)), 1e-12);
    EXPECT_NEAR(glm::length(parallel.direction - Vec3d(0, 0, -1)), 0.0, 1e-12);
  }
}

TEST(Pattern, a_fisheye_is_equidistant_and_sees_nothing_outside_of_its_circle) {
  const Sensor sensor{tilted(), Fisheye{21, 15, 1.5 * kPi}};
  std::size_t outside = 0;
  for (std::size_t i = 0; i < ray_count(sensor); ++i) {
    const double x = double(i % 21) - 10.0, y = 7.0 - double(i / 21);
    const double radius = std::sqrt(x * x + y * y) / 7.5;
    const Ray seen = local(sensor, i);
    ASSERT_EQ(is_valid(ray(sensor, i)), radius <= 1.0) << i;
    if (radius > 1.0) {
      ++outside;
      continue;
    }
    EXPECT_NEAR(std::acos(-seen.direction.z), 0.75 * kPi * radius, 1e-7) << i;
    EXPECT_NEAR(seen.direction.x * y, seen.direction.y * x, 1e-12) << i;
    EXPECT_GE(seen.direction.x * x + seen.direction.y * y, 0.0) << i;
    EXPECT_NEAR(glm::length(seen.direction), 1.0, 1e-15);
  }
  EXPECT_GT(outside, 100U);
}

TEST(Pattern, a_lidar_turns_ring_by_ring) {
  const Sensor sensor{tilted(), Lidar{{-0.3, 0.0, 0.5 * kPi}, -0.2, 0.1, 7}, 120.0};
  ASSERT_EQ(ray_count(sensor), 21U);
  for (std::size_t i = 0; i < 14; ++i) {
    const Ray beam = local(sensor, i);
    EXPECT_NEAR(std::asin(beam.direction.y), i < 7 ? -0.3 : 0.0, 1e-12);
    EXPECT_NEAR(std::atan2(-beam.direction.x, -beam.direction.z), -0.2 + 0.1 * double(i % 7), 1e-12);
    EXPECT_EQ(beam.tfar, 120.0);
  }
  EXPECT_NEAR(local(sensor, 20).direction.y, 1.0, 1e-15);
}

TEST(Pattern, a_grid_looks_from_its_nodes) {
  const Sensor sensor{tilted(), Grid{4, 3, 0.5, 2.0}};
  const Vec3d first = local(sensor, 0).origin, last = local(sensor, 11).origin;
  EXPECT_NEAR(glm::length(first - Vec3d(-0.75, 2.0, 0.0)), 0.0, 1e-12);
  EXPECT_NEAR(glm::length(last - Vec3d(0.75, -2.0, 0.0)), 0.0, 1e-12);
  EXPECT_EQ(ray(sensor, 5).direction, ray(sensor, 0).direction);
}

TEST(Pattern, what_is_wrong_with_a_sensor_is_named) {
  const auto where = [](const Sensor& sensor) {
    const Status status = check(sensor);
    return status ? std::string() : status.error().where;
  };
  EXPECT_EQ(where({tilted(), Pinhole{8, 6, 0.9}}), "");
  EXPECT_EQ(where({{Mat3d(2.0), Vec3d(0.0)}, Pinhole{8, 6, 0.9}}), "/pose");
  EXPECT_EQ(where({tilted(), Pinhole{8, 6, kPi}}), "/yfov_deg");
  EXPECT_EQ(where({tilted(), Orthographic{8, 6, 0.0}}), "/height");
  EXPECT_EQ(where({tilted(), Fisheye{8, 6, 6.4}}), "/fov_deg");
  EXPECT_EQ(where({tilted(), Lidar{{1.6}, 0, 0, 1}}), "/elevations_deg");
  EXPECT_EQ(where({tilted(), Grid{1, 1, 1.0, -1.0}}), "/spacing");
  EXPECT_EQ(where({tilted(), Grid{1, 1}, 0.0}), "/max_range");
  EXPECT_EQ(ray_count({tilted(), Grid{70'000, 70'000}}), 0U);
}

TEST(Noise, is_normal_and_a_function_of_its_arguments) {
  constexpr int kCount = 40'000;
  double sum = 0.0, squares = 0.0, fourth = 0.0, across = 0.0;
  for (std::uint64_t i = 0; i < kCount; ++i) {
    const double x = normal_sample(7, i, 0), y = normal_sample(7, i, 1);
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
    across += x * y;
  }
  // Five standard errors each.
  EXPECT_NEAR(sum / kCount, 0.0, 5.0 / std::sqrt(kCount));
  EXPECT_NEAR(squares / kCount, 1.0, 5.0 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(fourth / kCount, 3.0, 5.0 * std::sqrt(96.0 / kCount));
  EXPECT_NEAR(across / kCount, 0.0, 5.0 / std::sqrt(kCount));
  EXPECT_EQ(normal_sample(7, 3, 1), normal_sample(7, 3, 1));
  EXPECT_NE(normal_sample(7, 3, 1), normal_sample(8, 3, 1));
  EXPECT_NE(normal_sample(7, 3, 1), normal_sample(7, 4, 0));
}

TEST(Noise, moves_hits_alone_and_by_ray_and_echo) {
  HitColumns hits;
  hits.resize(3, HitField{});
  hits.status = {RayStatus::kHit, RayStatus::kMiss, RayStatus::kHit};
  hits.t = {10.0, std::numeric_limits<double>::infinity(), 0.0};
  const RangeNoise noise{0.5, 11};
  add_noise(noise, hits);
  EXPECT_EQ(hits.t[0], 10.0 + 0.5 * normal_sample(11, 0, 0));
  EXPECT_EQ(hits.t[1], std::numeric_limits<double>::infinity());
  EXPECT_EQ(hits.t[2], std::max(0.0, 0.5 * normal_sample(11, 2, 0)));
  HitLists lists;
  lists.status = {RayStatus::kHit, RayStatus::kMiss, RayStatus::kHit};
  lists.splits = {0, 1, 1, 3};
  lists.hits.t = {10.0, 20.0, 30.0};
  add_noise(noise, lists);
  EXPECT_EQ(lists.hits.t[0], 10.0 + 0.5 * normal_sample(11, 0, 0));
  EXPECT_EQ(lists.hits.t[2], 30.0 + 0.5 * normal_sample(11, 2, 1));
}

}  // namespace
}  // namespace gridcast::sensor
