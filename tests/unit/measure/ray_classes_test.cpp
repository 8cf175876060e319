#include "core/measure/ray_classes.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/scene/scene.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::measure {
namespace {

/// One instance of `mesh`, moved and doubled in size.
std::shared_ptr<const scene::Scene> scene_of(mesh::TriangleMesh mesh) {
  scene::SceneData data;
  data.meshes.push_back(test::share(std::move(mesh)));
  data.deformations.resize(1);
  data.instances.push_back({{}, {Mat3d(2.0), Vec3d(5.0, -3.0, 1.0)}, 0});
  return scene::build_scene(std::move(data)).value();
}

View view_of(const scene::Scene& scene) {
  return framed_scene("", {}, scene.bounds()).view;
}

double distance_to_segment(const Ray& ray, const Vec3d& a, const Vec3d& b) {
  const Vec3d d = glm::normalize(ray.direction), e = b - a;
  const Vec3d n = glm::cross(d, e);
  if (glm::length(n) > 0.0) {
    const double s = glm::dot(glm::cross(d, ray.origin - a), n) / glm::dot(n, n);
    if (s >= 0.0 && s <= 1.0) return std::abs(glm::dot(ray.origin - a, glm::normalize(n)));
  }
  return std::min(glm::length(glm::cross(a - ray.origin, d)), glm::length(glm::cross(b - ray.origin, d)));
}

/// How near the ray's line comes to any vertex, or to any edge.
double nearest(const scene::Scene& scene, const Ray& ray, RayClass what) {
  const mesh::TriangleMesh& mesh = scene.blas(0).mesh();
  const Affine& place = scene.instance(0).transform.world_from_object();
  double least = 1e30;
  for (std::uint32_t i = 0; i < mesh.triangle_count(); ++i) {
    const auto corners = mesh.corners(i);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3d a = place.point(Vec3d(corners[k]));
      const Vec3d b = what == RayClass::kVertex ? a : place.point(Vec3d(corners[(k + 1) % 3]));
      least = std::min(least, distance_to_segment(ray, a, b));
    }
  }
  return least;
}

TEST(RayClasses, HaveNames) {
  for (const RayClass ray_class : kAllRayClasses)
    EXPECT_EQ(parse_ray_class(to_string(ray_class)).value(), ray_class);
  EXPECT_EQ(parse_ray_class("sideways").error().where, "/ray_class");
}

TEST(RayClasses, EdgesAndVerticesAreMetWithinTheRoundingOfFloats) {
  const auto scene = scene_of(test::jittered_icosphere(2, test::seed_or(4701)));
  const RayClassMaker maker(*scene, view_of(*scene), test::seed_or(4702));
  for (const RayClass ray_class : {RayClass::kEdge, RayClass::kVertex}) {
    SCOPED_TRACE(to_string(ray_class));
    const RaySet rays = maker.make(ray_class, 300).value();
    ASSERT_EQ(rays.size(), 300U);
    for (std::size_t i = 0; i < rays.size(); ++i)
      ASSERT_LE(nearest(*scene, rays.batch()[i], ray_class), 3e-6) << "ray " << i;
  }
  // Rays that do not aim come nowhere near.
  const RaySet others = maker.make(RayClass::kRandom, 100).value();
  std::size_t near = 0;
  for (std::size_t i = 0; i < others.size(); ++i)
    near += nearest(*scene, others.batch()[i], RayClass::kVertex) <= 3e-6 ? 1 : 0;
  EXPECT_EQ(near, 0U);
}

TEST(RayClasses, AThirdStartsInsideOfAClosedMeshAndNoneOfAnOpenOne) {
  const auto closed = scene_of(test::icosphere(2));
  const RayClassMaker inside(*closed, view_of(*closed), 7);
  for (const RayClass ray_class : {RayClass::kRandom, RayClass::kEdge, RayClass::kVertex}) {
    const RaySet rays = inside.make(ray_class, 600).value();
    const auto flags = inside.starts_inside(rays, {}).value();
    EXPECT_GE(std::count(flags.begin(), flags.end(), 1), 200);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const double from_center = glm::length(rays.batch()[i].origin - Vec3d(5.0, -3.0, 1.0));
      const int expected = from_center < 1.9 ? 1 : from_center > 2.0 ? 0 : flags[i];
      EXPECT_EQ(flags[i], expected) << "ray " << i;
    }
  }
  const auto open = scene_of(test::quad_grid(8));
  const RayClassMaker none(*open, view_of(*open), 7);
  const auto flags = none.starts_inside(none.make(RayClass::kRandom, 300).value(), {}).value();
  EXPECT_EQ(std::count(flags.begin(), flags.end(), 1), 0);
}

TEST(RayClasses, GrazingRaysAreNearlyInAPlane) {
  const auto scene = scene_of(test::quad_grid(8));
  const RayClassMaker maker(*scene, view_of(*scene), test::seed_or(4703));
  const RaySet rays = maker.make(RayClass::kGrazing, 500).value();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Vec3d d = glm::normalize(rays.batch()[i].direction);
    ASSERT_LE(std::abs(d.z), 0.11) << "ray " << i;
  }
}

TEST(RayClasses, AxisRaysHaveZerosOfBothSigns) {
  const auto scene = scene_of(test::icosphere(1));
  const RayClassMaker maker(*scene, view_of(*scene), test::seed_or(4704));
  const RaySet rays = maker.make(RayClass::kAxis, 400).value();
  std::size_t negative = 0, positive = 0;
  for (const auto& row : rays.rows) {
    const int zeros = int(row[4] == 0.F) + int(row[5] == 0.F) + int(row[6] == 0.F);
    ASSERT_EQ(zeros, 2);
    for (std::size_t k = 4; k < 7; ++k)
      if (row[k] == 0.F) ++(std::signbit(row[k]) ? negative : positive);
  }
  EXPECT_GT(negative, 200U);
  EXPECT_GT(positive, 200U);
}

TEST(RayClasses, TheSameSeedGivesTheSameRays) {
  const auto scene = scene_of(test::icosphere(2));
  const RayClassMaker a(*scene, view_of(*scene), 3), b(*scene, view_of(*scene), 3);
  const RayClassMaker other(*scene, view_of(*scene), 4);
  for (const RayClass ray_class : kAllRayClasses) {
    SCOPED_TRACE(to_string(ray_class));
    EXPECT_EQ(a.make(ray_class, 50).value().rows, b.make(ray_class, 50).value().rows);
  }
  EXPECT_NE(a.make(RayClass::kEdge, 50).value().rows, other.make(RayClass::kEdge, 50).value().rows);
}

}  // namespace
}  // namespace gridcast::measure
