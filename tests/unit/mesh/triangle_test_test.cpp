#include "core/mesh/triangle_test.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::mesh {
namespace {

using test::Random;

ObjectRay prepared(const Ray& ray, const TriangleMesh& mesh) {
  ObjectRay result;
  EXPECT_TRUE(result.prepare(ray, mesh.bounds()));
  return result;
}

template <Precision kPrecision>
int count_hits(const TriangleMesh& mesh, const Ray& ray) {
  ObjectRay object_ray;
  if (!object_ray.prepare(ray, mesh.bounds())) return 0;
  int hits = 0;
  for (std::uint32_t i = 0; i < mesh.triangle_count(); ++i) {
    const auto [p0, p1, p2] = mesh.corners(i);
    TriangleHit hit;
    hits += int(intersect_triangle<kPrecision>(object_ray, p0, p1, p2, hit) && hit.t >= ray.tnear &&
                hit.t <= ray.tfar);
  }
  return hits;
}

TEST(TriangleTest, distance_and_barycentrics_are_exact_for_small_integers) {
  const TriangleMesh mesh = test::single_triangle();
  const Ray ray{{0.25, 0.5, 4.0}, {0.0, 0.0, -2.0}};
  const auto [p0, p1, p2] = mesh.corners(0);
  TriangleHit hit;
  ASSERT_TRUE(intersect_triangle_robust(prepared(ray, mesh), p0, p1, p2, hit));
  EXPECT_EQ(hit.t, 2.0);
  EXPECT_EQ(hit.u, 0.25);
  EXPECT_EQ(hit.v, 0.5);
  // Half the pad, which is 2^-18 here, in units of a direction of length 2.
  ASSERT_TRUE(intersect_triangle_fast(prepared(ray, mesh), p0, p1, p2, hit));
  EXPECT_NEAR(hit.t, 2.0, 0x1p-20);
}

TEST(TriangleTest, a_ray_in_the_plane_of_the_triangle_does_not_hit_it) {
  const TriangleMesh mesh = test::single_triangle();
  const auto [p0, p1, p2] = mesh.corners(0);
  Random random(test::seed_or(1));
  for (int i = 0; i < 1000; ++i) {
    const Ray ray{{random.uniform(-2, 2), random.uniform(-2, 2), 0.0},
                  {random.uniform(-1, 1), random.uniform(-1, 1), 0.0}};
    ObjectRay object_ray;
    if (!object_ray.prepare(ray, mesh.bounds())) continue;
    TriangleHit hit;
    EXPECT_FALSE(intersect_triangle_robust(object_ray, p0, p1, p2, hit));
    EXPECT_FALSE(intersect_triangle_fast(object_ray, p0, p1, p2, hit));
  }
}

TEST(TriangleTest, in_plane_rays_miss_even_when_the_shear_rounds) {
  // The plane x = 3y: the shear by 1/5 and 3/5 is inexact, so the sheared triangle has a little area.
  TriangleMesh mesh;
  mesh.positions = {{3, 1, 0}, {-3, -1, 1}, {6, 2, 7}};
  mesh.triangles = {{0, 1, 2}};
  const auto [p0, p1, p2] = mesh.corners(0);
  Random random(test::seed_or(3));
  for (int i = 0; i < 2000; ++i) {
    const auto y = double(random.below(9)) - 4.0, z = double(random.below(9)) - 4.0;
    const auto dy = double(random.below(21)) - 10.0, dz = double(random.below(21)) - 10.0;
    const Ray ray{{3.0 * y, y, z}, {3.0 * dy, dy, dz}};
    ObjectRay object_ray;
    if (!is_valid(ray) || !object_ray.prepare(ray, mesh.bounds())) continue;
    TriangleHit hit;
    ASSERT_FALSE(intersect_triangle_robust(object_ray, p0, p1, p2, hit))
        << y << " " << z << " " << dy << " " << dz;
  }
}

TEST(TriangleTest, a_triangle_without_area_is_never_hit) {
  Random random(test::seed_or(4));
  for (int i = 0; i < 20000; ++i) {
    // Collinear in floats exactly: a, a + e, a + k e with small integers.
    auto small = [&] { return double(random.below(17)) - 8.0; };
    const Vec3d a{small(), small(), small()}, e{small(), small(), small()};
    TriangleMesh mesh;
    mesh.positions = {Vec3f(a), Vec3f(a + e), Vec3f(a + double(random.below(5)) * e)};
    mesh.triangles = {{0, 1, 2}};
    const Vec3d target = a + random.uniform(0.0, 1.0) * e;
    const Ray ray{target - 3.0 * random.direction() + Vec3d(0.0, 0.0, 1.0), random.direction()};
    for (const Vec3d& direction : {ray.direction, target - ray.origin}) {
      EXPECT_EQ((count_hits<Precision::kRobust>(mesh, {ray.origin, direction})), 0);
      EXPECT_EQ((count_hits<Precision::kFast>(mesh, {ray.origin, direction})), 0);
    }
  }
}

TEST(TriangleTest, a_ray_exactly_through_an_edge_or_a_vertex_hits_every_triangle_that_has_it) {
  const TriangleMesh mesh = test::quad_grid(4, 4.F);
  EXPECT_EQ((count_hits<Precision::kRobust>(mesh, {{2, 2, 5}, {0, 0, -1}})), 6);
  EXPECT_EQ((count_hits<Precision::kRobust>(mesh, {{2, 2, 3}, {0.0, -0.0, -0.7}})), 6);
  EXPECT_EQ((count_hits<Precision::kRobust>(mesh, {{2, 1.5, 5}, {0, 0, -1}})), 2);
  EXPECT_EQ((count_hits<Precision::kRobust>(mesh, {{5, 5, 3}, {-3, -3, -3}})), 6);
}

TEST(TriangleTest, no_ray_leaves_a_closed_mesh_through_an_edge_or_a_vertex) {
  Random random(test::seed_or(2));
  for (const float offset : {0.F, 1000.F, 1e6F}) {
    const TriangleMesh mesh = test::translated(test::jittered_icosphere(2, 7), Vec3f(offset));
    for (int i = 0; i < 20000; ++i) {
      const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangle_count())));
      const double s = (i % 2) != 0 ? random.uniform() : 0.0;
      const Vec3d target = Vec3d(corners[0]) + s * (Vec3d(corners[1]) - Vec3d(corners[0]));
      const Vec3d origin = Vec3d(double(offset)) + random.in_box(0.2);
      EXPECT_GT((count_hits<Precision::kRobust>(mesh, {origin, target - origin})), 0);
    }
  }
}

}  // namespace
}  // namespace gridcast::mesh
