#include "core/blas/wide_steps.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/shapes.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

using Tree = std::shared_ptr<const WideBvh>;

Tree built(const TriangleMesh& mesh) {
  return WideBvh::build(mesh, {.spatial = SpatialSplits::kNever}, {}).value();
}
double steps_of(const WideBvh& tree, const TriangleMesh& mesh) {
  return steps_per_ray(tree.nodes(), tree.blocks(), mesh.bounds(), 64).value();
}
TriangleMesh shuffled(TriangleMesh mesh, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::shuffle(mesh.positions.begin(), mesh.positions.end(), engine);
  return mesh;
}

/// Squares across the x axis, one behind the other.
TriangleMesh walls(std::uint32_t count) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto x = float(i);
    mesh.positions.insert(mesh.positions.end(), {{x, -1, -1}, {x, 1, -1}, {x, 1, 1}, {x, -1, 1}});
    mesh.triangles.push_back({4 * i, 4 * i + 1, 4 * i + 2});
    mesh.triangles.push_back({4 * i, 4 * i + 2, 4 * i + 3});
  }
  return mesh;
}

TEST(WideSteps, a_counted_way_ends_at_the_hit_of_the_kernels) {
  const std::uint64_t seed = test::seed_or(131);
  for (const MeshCase& mesh_case : mesh_cases()) {
    SCOPED_TRACE(mesh_case.name);
    const TriangleMesh& mesh = *mesh_case.mesh;
    const Tree tree = built(mesh);
    RayMaker rays(mesh, seed);
    for (int i = 0; i < 200; ++i) {
      const Ray ray = i % 2 == 0 ? rays.through_space() : rays.at_edge();
      mesh::ObjectRay prepared;
      if (!prepared.prepare(ray, mesh.bounds())) continue;
      Hit counted{ray.tfar}, expected{ray.tfar};
      const WideSteps steps = steps_to_closest(tree->nodes(), tree->blocks(), prepared, counted);
      ClosestHit closest{expected};
      tree->intersect<Precision::kFast>(mesh, prepared, closest);
      ASSERT_EQ(counted.primitive_id, expected.primitive_id) << "ray " << i << ", seed " << seed;
      ASSERT_EQ(counted.t, expected.t);
      ASSERT_GE(steps.nodes, 1U);
      ASSERT_GE(steps.blocks, counted.valid() ? 1U : 0U);
      ASSERT_LE(steps.nodes, tree->nodes().size());
      ASSERT_LE(steps.blocks, tree->blocks().size());
    }
  }
}

TEST(WideSteps, a_ray_looks_at_the_nearest_boxes_first_and_not_behind_its_hit) {
  const TriangleMesh mesh = walls(1000);
  const Tree tree = built(mesh);
  for (const double direction : {1.0, -1.0}) {
    const Ray ray{{direction > 0.0 ? -5.0 : 1005.0, 0.3, 0.2}, {direction, 0.0, 0.0}};
    mesh::ObjectRay prepared;
    ASSERT_TRUE(prepared.prepare(ray, mesh.bounds()));
    Hit best{ray.tfar};
    const WideSteps steps = steps_to_closest(tree->nodes(), tree->blocks(), prepared, best);
    EXPECT_NEAR(best.t, direction > 0.0 ? 5.0 : 6.0, 1e-6);
    StructureStats stats;
    tree->add_stats(stats);
    EXPECT_LE(steps.nodes, stats.max_depth + 1) << "one on every level";
    EXPECT_LE(steps.blocks, 2U);
  }
}

TEST(WideSteps, one_leaf_is_two_steps_whatever_the_ray) {
  for (const int triangles : {1, 4}) {
    const TriangleMesh mesh = test::soup(triangles, 3);
    EXPECT_EQ(steps_of(*built(mesh), mesh), 2.0) << "the root and a block";
  }
  const TriangleMesh flat = test::single_triangle();
  EXPECT_EQ(steps_of(*built(flat), flat), 2.0);
}

TEST(WideSteps, they_do_not_depend_on_where_a_mesh_is_or_how_large) {
  const TriangleMesh mesh = test::jittered_icosphere(4, 2);
  TriangleMesh larger = mesh;
  for (Vec3f& p : larger.positions) p *= 1024.F;
  EXPECT_EQ(steps_of(*built(mesh), mesh), steps_of(*built(larger), larger));
}

TEST(WideSteps, nothing_is_counted_where_no_ray_can_be_sent) {
  EXPECT_EQ(steps_of(*built({}), {}), 0.0);
  TriangleMesh point = test::single_triangle();
  for (Vec3f& p : point.positions) p = {1.F, 2.F, 3.F};
  EXPECT_EQ(steps_of(*built(point), point), 0.0);
}

TEST(WideSteps, they_rise_when_a_refitted_tree_goes_bad_and_come_back_with_its_vertices) {
  const TriangleMesh mesh = test::jittered_icosphere(5, 3);
  const TriangleMesh mess = shuffled(mesh, test::seed_or(132));
  const Tree first = built(mesh), bad = first->refit(mess).value();
  EXPECT_GT(steps_of(*first, mesh), 3.0);
  EXPECT_GT(steps_of(*bad, mess), 1.3 * steps_of(*built(mess), mess));
  EXPECT_EQ(steps_of(*bad->refit(mesh).value(), mesh), steps_of(*first, mesh));
  EXPECT_EQ(steps_per_ray(first->nodes(), first->blocks(), mesh.bounds(), 0).value(), 0.0);
}

TEST(WideSteps, of_a_mesh_are_those_of_its_tree_and_of_other_structures_there_are_none) {
  const auto mesh = std::make_shared<const TriangleMesh>(test::jittered_icosphere(4, 3));
  const BuildOptions options{.kind = StructureKind::kWideBvh};
  const Blas built = Blas::build(mesh, options).value();
  const Tree tree = WideBvh::build(*mesh, options, {}).value();
  for (const std::size_t rays : {1U, 16U, 200U})
    EXPECT_EQ(built.steps_per_ray(rays).value(),
              steps_per_ray(tree->nodes(), tree->blocks(), mesh->bounds(), rays).value());
  for (const StructureKind kind : {StructureKind::kBruteForce, StructureKind::kBvh, StructureKind::kKdTree})
    EXPECT_FALSE(Blas::build(mesh, {.kind = kind}).value().steps_per_ray(16).value().has_value());
}

TEST(WideSteps, counting_ends_when_it_is_stopped) {
  const Blas built = Blas::build(std::make_shared<const TriangleMesh>(test::jittered_icosphere(3, 3)),
                                 {.kind = StructureKind::kWideBvh})
                         .value();
  std::stop_source source;
  EXPECT_TRUE(built.steps_per_ray(16, source.get_token()).ok());
  source.request_stop();
  const auto stopped = built.steps_per_ray(16, source.get_token());
  ASSERT_FALSE(stopped.ok());
  EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::blas
