#include <cmath>
#include <cstring>

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include "core/blas/bvh.h"
#include "core/blas/bvh_builder.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

constexpr BvhSplit kSplits[] = {BvhSplit::kMidpoint, BvhSplit::kMedian, BvhSplit::kBinnedSah};

std::shared_ptr<const Bvh> build(const TriangleMesh& mesh, BvhSplit split) {
  return Bvh::build(mesh, {.split = split}, {}).value();
}

StructureStats stats_of(const Bvh& bvh) {
  StructureStats stats;
  bvh.add_stats(stats);
  return stats;
}

BvhTree tree_on(int threads, const TriangleMesh& mesh, BvhSplit split) {
  tbb::task_arena arena(threads);
  return arena.execute([&] { return build_bvh(mesh, {.split = split, .task_size = 64}, {}).value(); });
}

TEST(BvhBuild, every_mesh_gives_a_valid_tree_with_every_split) {
  for (const MeshCase& mesh_case : mesh_cases()) {
    for (const BvhSplit split : kSplits) {
      SCOPED_TRACE(mesh_case.name + ", " + std::string(to_string(split)));
      const auto bvh = build(*mesh_case.mesh, split);
      const Status status = bvh->validate(*mesh_case.mesh);
      EXPECT_TRUE(status.ok()) << (status.ok() ? "" : status.error().where + status.error().message);
      const StructureStats stats = stats_of(*bvh);
      EXPECT_EQ(stats.reference_count, mesh_case.mesh->triangle_count());
      EXPECT_EQ(stats.leaf_count * 2, stats.node_count + 1);
      EXPECT_GT(stats.cost, 0.0);
      EXPECT_TRUE(std::isfinite(stats.cost));
    }
  }
}

TEST(BvhBuild, the_tree_is_the_same_on_one_thread_and_on_many) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  // Large enough for parallel bounds and bins, with signed zeros that min and max could mix up.
  TriangleMesh mesh = test::soup(60000, test::seed_or(31));
  for (std::size_t i = 0; i < mesh.positions.size(); i += 3) mesh.positions[i].x = i % 2 == 0 ? 0.F : -0.F;
  for (const BvhSplit split : kSplits) {
    const BvhTree one = tree_on(1, mesh, split);
    for (int run = 0; run < 3; ++run) {
      const BvhTree many = tree_on(4, mesh, split);
      EXPECT_EQ(one.primitive_ids, many.primitive_ids);
      ASSERT_EQ(one.nodes.size(), many.nodes.size());
      EXPECT_EQ(std::memcmp(one.nodes.data(), many.nodes.data(), one.nodes.size() * sizeof(BvhNode)), 0);
    }
  }
}

TEST(BvhBuild, the_size_of_a_task_does_not_change_the_tree) {
  const TriangleMesh mesh = test::torus(60, 40);
  const BvhTree whole = build_bvh(mesh, {.task_size = 1 << 20}, {}).value();
  const BvhTree parts = build_bvh(mesh, {.task_size = 16}, {}).value();
  EXPECT_EQ(whole.primitive_ids, parts.primitive_ids);
  ASSERT_EQ(whole.nodes.size(), parts.nodes.size());
  EXPECT_EQ(std::memcmp(whole.nodes.data(), parts.nodes.data(), whole.nodes.size() * sizeof(BvhNode)), 0);
}

TEST(BvhBuild, the_surface_area_split_costs_less_than_the_blind_ones) {
  const TriangleMesh mesh = test::jittered_icosphere(5, 3);
  const double sah = stats_of(*build(mesh, BvhSplit::kBinnedSah)).cost;
  EXPECT_LT(sah, stats_of(*build(mesh, BvhSplit::kMidpoint)).cost);
  EXPECT_LT(sah, stats_of(*build(mesh, BvhSplit::kMedian)).cost);
}

TEST(BvhBuild, one_triangle_is_one_leaf) {
  const TriangleMesh mesh = test::single_triangle();
  for (const BvhSplit split : kSplits) {
    const StructureStats stats = stats_of(*build(mesh, split));
    EXPECT_EQ(stats.node_count, 1U);
    EXPECT_EQ(stats.leaf_count, 1U);
    EXPECT_EQ(stats.max_depth, 0U);
  }
}

TEST(BvhBuild, a_hundred_thousand_identical_triangles_are_halved) {
  const TriangleMesh mesh = test::repeated(test::single_triangle(), 100000);
  for (const BvhSplit split : kSplits) {
    const auto bvh = build(mesh, split);
    EXPECT_TRUE(bvh->validate(mesh).ok());
    EXPECT_LE(stats_of(*bvh).max_depth, 16U);
  }
}

TEST(BvhBuild, concentric_triangles_with_one_center_are_halved) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < 30000; ++i) {
    const float r = float(i + 1);
    mesh.positions.insert(mesh.positions.end(), {{-r, -r, 0}, {r, -r, 0}, {-r, r, 0}});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  for (const BvhSplit split : kSplits) {
    const auto bvh = build(mesh, split);
    EXPECT_TRUE(bvh->validate(mesh).ok());
    EXPECT_LE(stats_of(*bvh).max_depth, 32U);
  }
}

// Each triangle half as far from the origin as the one before: splits by place peel off a few at a time.
TEST(BvhBuild, a_geometric_series_stays_within_the_depth_of_the_stack) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < 100000; ++i) {
    const float at = std::ldexp(1.F, -int(i % 140)) * (1.F + 1e-3F * float(i / 140));
    mesh.positions.insert(mesh.positions.end(), {{at, 0, 0}, {at, at, 0}, {at, 0, at}});
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  for (const BvhSplit split : kSplits) {
    const auto bvh = build(mesh, split);
    EXPECT_TRUE(bvh->validate(mesh).ok());
    EXPECT_LE(stats_of(*bvh).max_depth, kMaxBvhDepth);
  }
  // The bound is what keeps it there: midpoints alone would go as deep as there are octaves.
  EXPECT_GT(stats_of(*build(mesh, BvhSplit::kMidpoint)).max_depth, kMaxFreeDepth);
}

TEST(BvhBuild, a_stop_request_cancels_the_build) {
  std::stop_source stop;
  stop.request_stop();
  const TriangleMesh mesh = test::icosphere(3);
  for (const BvhSplit split : kSplits) {
    const auto built = Bvh::build(mesh, {.split = split}, stop.get_token());
    ASSERT_FALSE(built.ok());
    EXPECT_EQ(built.error().code, ErrorCode::kCancelled);
  }
}

}  // namespace
}  // namespace gridcast::blas
