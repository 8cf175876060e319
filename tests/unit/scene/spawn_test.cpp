// Origins of secondary rays against exact rationals, and the rays themselves against the triangle they leave.

#include "core/scene/spawn.h"

#include <algorithm>
#include <iostream>

#include "tests/support/hostile.h"
#include "tests/support/rational.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

std::shared_ptr<const Scene> scene_of(const std::array<Vec3f, 3>& corners, const Affine& placed) {
  mesh::TriangleMesh mesh;
  mesh.positions = {corners.begin(), corners.end()};
  mesh.triangles = {{0, 1, 2}};
  SceneData data;
  data.meshes = {test::share(std::move(mesh))};
  data.deformations.resize(1);
  place(data, 0, placed);
  return built(std::move(data));
}

SurfaceHit hit_at(double u, double v) {
  SurfaceHit hit;
  hit.status = RayStatus::kHit;
  hit.u = u;
  hit.v = v;
  hit.instance_id = hit.mesh_id = hit.primitive_id = 0;
  return hit;
}

SurfaceHit any_hit(test::Random& random) {
  double u = random.uniform(), v = random.uniform();
  if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
  if (random.below(6) == 0) v = 0.0;
  if (random.below(12) == 0) u = v = 0.0;
  return hit_at(u, v);
}

int sign(const test::Rational& value) {
  return sgn(value);
}

TEST(SpawnPoint, origins_of_the_hostile_set_are_off_the_plane_on_the_right_side) {
  test::Random random(test::seed_or(351));
  for (int i = 0; i < 1500; ++i) {
    const test::HostileTriangle triangle = test::hostile_triangle(random);
    const Affine& placed = triangle.transform.world_from_object();
    const auto scene = scene_of(triangle.corners, placed);
    const test::RationalPlane plane(placed, triangle.corners);
    for (int k = 0; k < 6; ++k) {
      const SpawnPoint from(*scene, any_hit(random));
      const Vec3d direction = random.direction();
      const Ray ray = from.ray(direction);
      ASSERT_TRUE(is_valid(ray));
      EXPECT_EQ(ray.direction, direction);
      EXPECT_EQ(ray.tnear, 0.0);
      EXPECT_EQ(sign(plane.height(test::rational(ray.origin))), sign(plane.slope(ray)));
      // What is off already stays where it is; what is not is moved there, from wherever it is.
      EXPECT_EQ(from.origin(ray.origin, direction), ray.origin);
      const Vec3d other = from.origin(ray.origin, -direction);
      EXPECT_EQ(sign(plane.height(test::rational(other))), -sign(plane.slope(ray)));
    }
  }
}

TEST(SpawnPoint, rays_do_not_hit_the_triangle_that_they_leave) {
  test::Random random(test::seed_or(352));
  std::size_t again = 0, without = 0;
  for (int i = 0; i < 1500; ++i) {
    const test::HostileTriangle triangle = test::hostile_triangle(random);
    const auto scene = scene_of(triangle.corners, triangle.transform.world_from_object());
    for (int k = 0; k < 16; ++k) {
      const SpawnPoint from(*scene, any_hit(random));
      const Ray ray = from.ray(random.direction() * std::exp2(random.uniform(-20.0, 20.0)));
      for (const Precision precision : {Precision::kRobust, Precision::kExact}) {
        again += std::size_t(intersect(*scene, ray, precision).status == RayStatus::kHit);
        again += std::size_t(occluded(*scene, ray, precision) == RayStatus::kHit);
      }
      without += std::size_t(occluded(*scene, {from.position(), ray.direction}) == RayStatus::kHit);
      EXPECT_EQ(occluded(*scene, ray, Precision::kFast, from.primitive()), RayStatus::kMiss);
    }
  }
  EXPECT_EQ(again, 0U);
  EXPECT_GT(without, 1000U) << "the set is harmless: nothing is hit again from the bare hit points";
}

TEST(SpawnPoint, a_ray_to_a_target_starts_on_its_side_and_ends_there) {
  test::Random random(test::seed_or(353));
  const auto scene = scene_of({Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)}, {Mat3d(2.0), {5, 6, 7}});
  for (int i = 0; i < 200; ++i) {
    const SpawnPoint from(*scene, any_hit(random));
    const Vec3d target = Vec3d(5, 6, 7) + random.in_box(3.0);
    const Ray ray = from.ray_to(target);
    EXPECT_EQ(ray.origin.z > 7.0, target.z > 7.0);
    EXPECT_NE(ray.origin.z, 7.0);
    EXPECT_EQ(ray.tfar, 1.0);
    EXPECT_LT(max_abs(ray.origin + ray.direction - target), 1e-14);
    EXPECT_EQ(occluded(*scene, ray), RayStatus::kMiss);
  }
}

// One rounding of the coordinates where the plane is one of theirs, and no dependence on where the ray came
// from: the point is that of the triangle.
TEST(SpawnPoint, offsets_are_a_few_roundings) {
  const auto scene =
      scene_of({Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)}, {Mat3d(1.0), {1e6, -1e6, 0.0}});
  const SpawnPoint near_origin(*scene, hit_at(0.25, 0.25));
  const double low = near_origin.ray({0.0, 0.0, 1.0}).origin.z;
  EXPECT_GT(low, 0.0);
  EXPECT_LT(low, 0x1p-46);
  const auto raised =
      scene_of({Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0)}, {Mat3d(1.0), {0.0, 0.0, 1e6}});
  const SpawnPoint high(*raised, hit_at(0.25, 0.25));
  EXPECT_EQ(high.ray({0.0, 0.0, 1.0}).origin.z, std::nextafter(1e6, 2e6));
  EXPECT_EQ(high.ray({0.0, 0.0, -1.0}).origin.z, std::nextafter(1e6, 0.0));
}

}  // namespace
}  // namespace gridcast::scene
