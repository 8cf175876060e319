#include "core/blas/wide_morton_builder.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include "core/blas/wide_clusters.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

struct Built {
  WideNodes nodes;
  TriangleBlocks blocks;
};

Built built(const TriangleMesh& mesh) {
  Built out;
  EXPECT_TRUE(build_wide_in_morton_order(mesh, {}, out.nodes, out.blocks).ok());
  return out;
}

template <class Vector>
bool same_bytes(const Vector& a, const Vector& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
}

/// Ascending codes with numbers, from gaps.
MortonKeys keys_with_gaps(std::size_t count, test::Random& random, std::uint32_t gap_bits) {
  MortonKeys keys(count);
  std::uint64_t code = 0;
  for (std::size_t i = 0; i < count; ++i) {
    code += random.below(1U << random.below(gap_bits));
    keys[i] = code << kMortonNumberBits | i;
  }
  return keys;
}

TEST(WideMortonBuilder, the_tree_is_the_same_on_one_thread_and_on_many) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  const TriangleMesh mesh = test::soup(100000, test::seed_or(33));
  const auto on = [&](int count) {
    tbb::task_arena arena(count);
    return arena.execute([&] { return built(mesh); });
  };
  const Built one = on(1);
  for (int run = 0; run < 3; ++run) {
    const Built many = on(4);
    EXPECT_TRUE(same_bytes(one.nodes, many.nodes));
    EXPECT_TRUE(same_bytes(one.blocks, many.blocks));
  }
}

TEST(WideMortonBuilder, a_refit_of_the_same_vertices_draws_the_same_bits) {
  for (const MeshCase& mesh_case : mesh_cases()) {
    SCOPED_TRACE(mesh_case.name);
    const auto tree = WideBvh::build(*mesh_case.mesh, {.quality = BuildQuality::kFast}, {}).value();
    const auto again = tree->refit(*mesh_case.mesh).value();
    EXPECT_TRUE(same_bytes(tree->nodes(), again->nodes()));
    EXPECT_TRUE(same_bytes(tree->blocks(), again->blocks()));
    EXPECT_TRUE(std::ranges::equal(tree->part_costs(), again->part_costs()));
  }
}

TEST(WideMortonBuilder, clusters_have_as_few_blocks_as_hold_their_triangles) {
  test::Random random(test::seed_or(34));
  for (int round = 0; round < 300; ++round) {
    const MortonKeys keys = keys_with_gaps(1 + random.below(2000), random, 1 + std::uint32_t(round) % 20);
    const WideClusters clusters(keys);
    std::uint32_t next_key = 0, next_block = 0;
    for (const WideCluster& cluster : clusters.all) {
      ASSERT_EQ(cluster.first_key, next_key);
      ASSERT_EQ(cluster.first_block, next_block);
      ASSERT_TRUE(cluster.slots >= 1 && cluster.slots <= 8);
      std::uint32_t begin = 0;
      for (std::uint32_t slot = 0; slot < cluster.slots; begin = cluster.ends[slot++])
        ASSERT_TRUE(cluster.ends[slot] > begin && cluster.ends[slot] <= begin + kMaxWideLeaf);
      next_key += begin;
      next_block += (begin + 3) / 4;
    }
    EXPECT_EQ(next_key, keys.size());
    EXPECT_EQ(next_block, clusters.block_count);
  }
}

TEST(WideMortonBuilder, slots_end_where_the_curve_leaves_a_cell) {
  MortonKeys keys(12);
  for (std::size_t i = 0; i < keys.size(); ++i) keys[i] = (i / 4 * 1000) << kMortonNumberBits | i;
  const WideClusters clusters(keys);
  ASSERT_EQ(clusters.all.size(), 1U);
  EXPECT_EQ(clusters.all[0].slots, 3U);
  EXPECT_EQ(clusters.all[0].ends[0], 4);
  EXPECT_EQ(clusters.all[0].ends[1], 8);
  EXPECT_EQ(clusters.all[0].ends[2], 12);
}

TEST(WideMortonBuilder, the_largest_leaf_of_a_node_is_looked_at_first) {
  for (const TriangleMesh& mesh : {test::jittered_icosphere(5, 21), test::soup(20, 6), test::soup(3000, 7)}) {
    for (const WideNode& node : built(mesh).nodes) {
      const auto area = [&](std::uint32_t slot) { return to_double(node.box(slot)).half_area(); };
      for (std::uint32_t slot = 1; slot < node.slots; ++slot) {
        if (!wide_child::is_leaf(node.child[slot])) continue;
        ASSERT_TRUE(wide_child::is_leaf(node.child[0]));
        ASSERT_GE(area(0), area(slot) * 0.99999);
      }
    }
  }
}

TEST(WideMortonBuilder, boxes_have_no_negative_zero) {
  TriangleMesh mesh = test::soup(1000, 8);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) mesh.positions[i].z = i % 2 == 0 ? 0.F : -0.F;
  for (const WideNode& node : built(mesh).nodes) {
    for (std::uint32_t slot = 0; slot < node.slots; ++slot) {
      ASSERT_FALSE(std::signbit(node.box(slot).lower.z));
      ASSERT_FALSE(std::signbit(node.box(slot).upper.z));
    }
  }
}

TEST(WideMortonBuilder, a_stop_cancels) {
  std::stop_source stop;
  stop.request_stop();
  Built out;
  const Status status =
      build_wide_in_morton_order(test::icosphere(3), stop.get_token(), out.nodes, out.blocks);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::blas
