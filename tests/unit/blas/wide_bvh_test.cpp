#include "core/blas/wide_bvh.h"

#include <cstring>

#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::blas {
namespace {

using mesh::TriangleMesh;

std::shared_ptr<const WideBvh> built(const TriangleMesh& mesh) {
  return WideBvh::build(mesh, {.spatial = SpatialSplits::kNever}, {}).value();
}

bool same_bits(const WideBvh& a, const WideBvh& b) {
  return a.nodes().size() == b.nodes().size() && a.blocks().size() == b.blocks().size() &&
         std::memcmp(a.nodes().data(), b.nodes().data(), a.nodes().size() * sizeof(WideNode)) == 0 &&
         std::memcmp(a.blocks().data(), b.blocks().data(), a.blocks().size() * sizeof(TriangleBlock)) == 0;
}

TEST(WideBvh, every_tree_is_valid_from_no_triangle_to_many) {
  for (const int triangles : {0, 1, 2, 3, 4, 5, 8, 9, 16, 17, 63, 64, 65, 1000, 20000}) {
    const TriangleMesh mesh = test::soup(triangles, 3);
    const Status status = built(mesh)->validate(mesh);
    EXPECT_TRUE(status.ok()) << triangles << ": " << status.error().where << " " << status.error().message;
  }
  for (const TriangleMesh& mesh : {test::repeated(test::single_triangle(), 5000), test::needle_fan(1000),
                                   test::slivers(2000, 4, 1e4F), test::quad_grid(40)}) {
    EXPECT_TRUE(built(mesh)->validate(mesh).ok());
  }
}

TEST(WideBvh, moving_one_vertex_out_of_the_box_is_caught_and_then_healed) {
  const TriangleMesh mesh = test::jittered_icosphere(3, 1);
  const auto bvh = built(mesh);
  ASSERT_TRUE(bvh->validate(mesh).ok());
  TriangleMesh changed = mesh;
  changed.positions[77] *= 3.F;
  const Status caught = bvh->validate(changed);
  ASSERT_FALSE(caught.ok());
  EXPECT_EQ(caught.error().where.substr(0, 7), "/nodes/");
  EXPECT_TRUE(bvh->refit(changed).value()->validate(changed).ok());
  EXPECT_TRUE(bvh->validate(mesh).ok()) << "the old tree must stay as it was";
}

TEST(WideBvh, returning_to_the_first_positions_gives_the_first_bits) {
  TriangleMesh mesh = test::soup(20000, test::seed_or(44));
  mesh.positions[0] = {-0.F, 0.F, -0.F};
  mesh.positions[1] = {0.F, -0.F, 0.F};
  const auto first = built(mesh);
  const TriangleMesh far = test::translated(mesh, Vec3f(3.F, -1.F, 2.F));
  const auto away = first->refit(far).value();
  EXPECT_FALSE(same_bits(*first, *away));
  EXPECT_TRUE(same_bits(*first, *away->refit(mesh).value()));
}

TEST(WideBvh, the_tree_does_not_depend_on_the_number_of_threads) {
  const TriangleMesh mesh = test::soup(30000, 9);
  std::shared_ptr<const WideBvh> one, four;
  oneapi::tbb::task_arena(1).execute([&] { one = built(mesh); });
  oneapi::tbb::task_arena(4).execute([&] { four = built(mesh); });
  EXPECT_TRUE(same_bits(*one, *four));
}

/// Any-hit rays look into the first slot before the others.
TEST(WideBvh, the_largest_leaf_of_a_node_is_in_its_first_slot) {
  TriangleMesh mesh = test::jittered_icosphere(4, 1);
  const auto first = std::uint32_t(mesh.positions.size()), huge = std::uint32_t(mesh.triangles.size());
  mesh.positions.insert(mesh.positions.end(), {{-50.F, -50.F, 0.5F}, {50.F, -50.F, 0.5F}, {0.F, 90.F, 0.5F}});
  mesh.triangles.push_back({first, first + 1, first + 2});
  const auto bvh = built(mesh);
  const WideNode& root = bvh->nodes()[0];
  ASSERT_TRUE(wide_child::is_leaf(root.child[0]));
  EXPECT_EQ(bvh->blocks()[wide_child::index(root.child[0])].ids[0], huge);
  for (const WideNode& node : bvh->nodes()) {
    for (std::uint32_t slot = 1; slot < node.slots; ++slot) {
      if (!wide_child::is_leaf(node.child[slot])) continue;
      ASSERT_TRUE(wide_child::is_leaf(node.child[0]));
      EXPECT_LE(node.box(slot).half_area(), node.box(0).half_area());
    }
  }
}

TEST(WideBvh, eight_children_make_few_nodes_and_full_blocks) {
  const TriangleMesh mesh = test::icosphere(5);
  const auto bvh = built(mesh);
  StructureStats stats;
  stats.triangle_count = mesh.triangle_count();
  bvh->add_stats(stats);
  EXPECT_LT(double(stats.node_count), 0.06 * double(mesh.triangle_count()));
  EXPECT_LT(double(stats.memory_bytes), 80.0 * double(mesh.triangle_count()));
  EXPECT_LE(stats.max_depth, 12U);
  EXPECT_GT(stats.cost, 0.0);
}

}  // namespace
}  // namespace gridcast::blas
