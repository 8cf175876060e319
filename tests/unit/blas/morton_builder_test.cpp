#include "core/blas/morton_builder.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

Blas fast(const std::shared_ptr<const TriangleMesh>& mesh, StructureKind kind = StructureKind::kWideBvh) {
  return Blas::build(mesh, {.kind = kind, .quality = BuildQuality::kFast}).value();
}

/// The same small triangle over and over.
TriangleMesh identical_triangles(std::size_t count) {
  TriangleMesh mesh = test::single_triangle();
  mesh.triangles = std::vector<mesh::Triangle>(count, mesh.triangles[0]);
  return mesh;
}

/// Centers at 2^-i, down to denormals: every split by codes takes off a few of them.
TriangleMesh octaves(std::size_t copies) {
  TriangleMesh mesh;
  for (std::size_t copy = 0; copy < copies; ++copy) {
    for (int i = 0; i < 126; ++i) {
      const auto first = std::uint32_t(mesh.positions.size());
      const float x = std::ldexp(1.F, -i);
      mesh.positions.insert(mesh.positions.end(), {{x, 0, 0}, {x, x / 16, 0}, {x, 0, x / 16}});
      mesh.triangles.push_back({first, first + 1, first + 2});
    }
  }
  return mesh;
}

TEST(MortonBuilder, a_million_identical_triangles_make_a_shallow_tree) {
  const auto mesh = test::share(identical_triangles(1'000'000));
  for (const StructureKind kind :
       {StructureKind::kWideBvh, StructureKind::kCompactBvh, StructureKind::kBvh}) {
    const Blas tree = fast(mesh, kind);
    const Status valid = tree.validate();
    EXPECT_TRUE(valid.ok()) << valid.error().message << valid.error().where;
    EXPECT_EQ(tree.stats().reference_count, 1'000'000U);
    EXPECT_LE(tree.stats().max_depth, 24U);
  }
}

TEST(MortonBuilder, the_depth_is_bounded_where_centers_crowd_geometrically) {
  for (const std::size_t copies : {1, 40, 2000}) {
    SCOPED_TRACE(copies);
    const auto mesh = test::share(octaves(copies));
    for (const StructureKind kind :
         {StructureKind::kWideBvh, StructureKind::kCompactBvh, StructureKind::kBvh}) {
      const Blas tree = fast(mesh, kind);
      const Status valid = tree.validate();
      EXPECT_TRUE(valid.ok()) << valid.error().message << valid.error().where;
      EXPECT_LE(tree.stats().max_depth, kMaxBvhDepth);
    }
  }
}

TEST(MortonBuilder, trees_cost_little_more_than_those_built_by_cost) {
  for (const auto& mesh : {test::share(test::jittered_icosphere(5, 21)),
                           test::share(test::soup(20000, 5, 0.1F)), test::share(test::torus(200, 100))}) {
    const Blas best =
        Blas::build(mesh, {.kind = StructureKind::kWideBvh, .spatial = SpatialSplits::kNever}).value();
    EXPECT_LT(fast(mesh).stats().cost, 1.3 * best.stats().cost);
  }
}

TEST(MortonBuilder, leaves_are_blocks_and_hold_every_triangle_once) {
  for (const MeshCase& mesh_case : mesh_cases()) {
    SCOPED_TRACE(mesh_case.name);
    const BvhTree tree = build_morton_bvh(*mesh_case.mesh, {}).value();
    std::vector<std::uint32_t> ids = tree.primitive_ids;
    std::sort(ids.begin(), ids.end());
    ASSERT_EQ(ids.size(), mesh_case.mesh->triangle_count());
    for (std::uint32_t i = 0; i < ids.size(); ++i) ASSERT_EQ(ids[i], i);
    std::uint32_t largest = 0;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i)
      if (i != 1) largest = std::max(largest, tree.nodes[i].count);
    EXPECT_LE(largest, 4U);
  }
}

TEST(MortonBuilder, the_tree_is_the_same_on_one_thread_and_on_many) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  const TriangleMesh mesh = test::soup(100000, test::seed_or(32));
  const auto on = [&](int count) {
    tbb::task_arena arena(count);
    return arena.execute([&] { return build_morton_bvh(mesh, {}).value(); });
  };
  const BvhTree one = on(1);
  for (int run = 0; run < 3; ++run) {
    const BvhTree many = on(4);
    EXPECT_EQ(one.primitive_ids, many.primitive_ids);
    ASSERT_EQ(one.nodes.size(), many.nodes.size());
    EXPECT_EQ(std::memcmp(one.nodes.data(), many.nodes.data(), one.nodes.size() * sizeof(BvhNode)), 0);
  }
}

TEST(MortonBuilder, no_triangles_make_no_tree_and_a_stop_cancels) {
  EXPECT_TRUE(build_morton_bvh(TriangleMesh{}, {}).value().nodes.empty());
  std::stop_source stop;
  stop.request_stop();
  const auto built = build_morton_bvh(test::icosphere(3), stop.get_token());
  ASSERT_FALSE(built.ok());
  EXPECT_EQ(built.error().code, ErrorCode::kCancelled);
}

TEST(MortonBuilder, a_fast_build_never_looks_for_a_kd_tree) {
  const auto mesh = test::share(test::slivers(3000, 11, 1e6F));
  const Blas tree = Blas::build(mesh, {.quality = BuildQuality::kFast}).value();
  EXPECT_EQ(tree.stats().kind, StructureKind::kWideBvh);
}

}  // namespace
}  // namespace gridcast::blas
