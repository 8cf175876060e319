// Refits of the wide tree: the same bits as a tree drawn from scratch, whatever was moved, however memory
// goes round, and however many threads draw.

#include <atomic>
#include <cstring>
#include <mutex>
#include <set>
#include <thread>

#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include "core/blas/wide_bvh.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

using Tree = std::shared_ptr<const WideBvh>;

Tree built(const TriangleMesh& mesh) {
  return WideBvh::build(mesh, {.spatial = SpatialSplits::kNever}, {}).value();
}

bool same_bits(const WideBvh& a, const WideBvh& b) {
  return a.nodes().size() == b.nodes().size() && a.blocks().size() == b.blocks().size() &&
         std::memcmp(a.nodes().data(), b.nodes().data(), a.nodes().size() * sizeof(WideNode)) == 0 &&
         std::memcmp(a.blocks().data(), b.blocks().data(), a.blocks().size() * sizeof(TriangleBlock)) == 0;
}

double cost_of(const WideBvh& tree) {
  StructureStats stats;
  tree.add_stats(stats);
  return stats.cost;
}

void expect_same(const WideBvh& a, const WideBvh& b) {
  EXPECT_TRUE(same_bits(a, b));
  EXPECT_EQ(cost_of(a), cost_of(b));
}

/// Large enough to be streamed past the caches; one vertex of each sign of zero.
TriangleMesh large_mesh(std::uint64_t seed) {
  TriangleMesh mesh = test::soup(60000, seed);
  mesh.positions[0] = {-0.F, 0.F, -0.F};
  mesh.positions[1] = {0.F, -0.F, 0.F};
  return mesh;
}

/// Moves `count` vertices, the last one of the mesh among them now and then. Returns which.
std::vector<std::uint32_t> move_some(TriangleMesh& mesh, std::size_t count, Random& random) {
  std::set<std::uint32_t> moved;
  if (random.below(3) == 0) moved.insert(std::uint32_t(mesh.positions.size() - 1));
  while (moved.size() < count) moved.insert(random.below(std::uint32_t(mesh.positions.size())));
  for (const std::uint32_t vertex : moved) mesh.positions[vertex] += Vec3f(random.in_box(0.2));
  return {moved.begin(), moved.end()};
}

TEST(WideRefit, there_and_back_gives_the_first_bits_and_cost_small_or_large) {
  for (const int triangles : {1, 5, 300, 3000, 60000}) {
    SCOPED_TRACE(triangles);
    const TriangleMesh mesh = triangles == 60000 ? large_mesh(1) : test::soup(triangles, 2);
    const Tree first = built(mesh);
    const TriangleMesh far = test::translated(mesh, Vec3f(3.F, -1.F, 2.F));
    const Tree away = first->refit(far).value();
    EXPECT_FALSE(same_bits(*first, *away));
    EXPECT_TRUE(away->validate(far).ok());
    expect_same(*first, *away->refit(mesh).value());
    expect_same(*away, *first->refit(far).value());  // twice the same
  }
}

TEST(WideRefit, a_patch_is_bit_for_bit_the_refit_of_everything) {
  const std::uint64_t seed = test::seed_or(61);
  Random random(seed);
  for (TriangleMesh mesh : {test::jittered_icosphere(5, 3), test::torus(90, 60), large_mesh(seed)}) {
    const Tree first = built(mesh);
    Tree patched = built(mesh);  // with memory of its own, which goes round undisturbed
    for (int step = 0; step < 30; ++step) {
      const auto vertices = move_some(mesh, std::size_t(1) << random.below(9), random);
      patched = patched->refit(mesh, vertices).value();
      ASSERT_TRUE(patched->validate(mesh).ok()) << "step " << step << ", seed " << seed;
      // The tree from the beginning has nothing of the steps between.
      ASSERT_NO_FATAL_FAILURE(expect_same(*first->refit(mesh).value(), *patched)) << "step " << step;
    }
  }
}

TEST(WideRefit, versions_that_are_still_read_stay_as_they_are) {
  const std::uint64_t seed = test::seed_or(62);
  Random random(seed);
  TriangleMesh mesh = test::jittered_icosphere(5, 3);
  struct Version {
    TriangleMesh mesh;
    Tree tree;
  };
  std::vector<Version> held{{mesh, built(mesh)}};
  for (int step = 0; step < 60; ++step) {
    // From any version that is held: histories branch.
    Version from = held[random.below(std::uint32_t(held.size()))];
    if (random.below(4) == 0) {
      from.mesh = test::translated(from.mesh, Vec3f(0.1F));
      from.tree = from.tree->refit(from.mesh).value();
    } else {
      const auto vertices = move_some(from.mesh, 1 + random.below(40), random);
      from.tree = from.tree->refit(from.mesh, vertices).value();
    }
    held.push_back(std::move(from));
    if (random.below(3) != 0)
      held.erase(held.begin() + std::ptrdiff_t(random.below(std::uint32_t(held.size()))));
    for (const Version& version : held)
      ASSERT_TRUE(version.tree->validate(version.mesh).ok()) << "step " << step << ", seed " << seed;
  }
}

TEST(WideRefit, refits_that_follow_each_other_go_round_in_two_pieces_of_memory) {
  TriangleMesh mesh = test::jittered_icosphere(4, 1);
  Tree tree = built(mesh);
  std::set<const WideNode*> nodes;
  std::set<const TriangleBlock*> blocks;
  for (int frame = 0; frame < 20; ++frame) {
    mesh.positions[5].x += 0.01F;
    tree =
        frame % 3 == 0 ? tree->refit(mesh).value() : tree->refit(mesh, std::vector<std::uint32_t>{5}).value();
    nodes.insert(tree->nodes().data());
    blocks.insert(tree->blocks().data());
  }
  EXPECT_EQ(nodes.size(), 2U);
  EXPECT_EQ(blocks.size(), 2U);
}

TEST(WideRefit, memory_of_a_version_some_patches_back_is_brought_up_to_date) {
  TriangleMesh mesh = test::jittered_icosphere(5, 3);
  const Tree fresh = built(mesh);
  std::vector<Tree> versions{built(mesh)};
  for (std::uint32_t step = 0; step < 12; ++step) {
    mesh.positions[step * 97].y += 0.1F;
    versions.push_back(versions.back()->refit(mesh, std::vector<std::uint32_t>{step * 97}).value());
    ASSERT_NO_FATAL_FAILURE(expect_same(*fresh->refit(mesh).value(), *versions.back())) << "step " << step;
    // The oldest goes, those between stay: the next patch finds memory of three versions ago.
    if (versions.size() == 4) versions.erase(versions.begin());
  }
}

TEST(WideRefit, a_reader_thread_sees_versions_whole_while_the_next_ones_are_drawn) {
  const std::uint64_t seed = test::seed_or(63);
  Random random(seed);
  struct Version {
    TriangleMesh mesh;
    Tree tree;
  };
  TriangleMesh mesh = test::jittered_icosphere(5, 3);
  auto current = std::make_shared<const Version>(Version{mesh, built(mesh)});
  std::mutex mutex;
  std::atomic<bool> done = false;
  std::atomic<int> read = 0, torn = 0;
  std::thread reader([&] {
    while (!done) {
      std::unique_lock lock(mutex);
      const std::shared_ptr<const Version> version = current;
      lock.unlock();
      torn += version->tree->validate(version->mesh).ok() ? 0 : 1;
      ++read;
    }
  });
  for (int step = 0; step < 400 || read < 20; ++step) {
    Tree next;
    if (step % 5 == 0) {
      mesh = test::translated(mesh, Vec3f(0.05F));
      next = current->tree->refit(mesh).value();
    } else {
      const auto vertices = move_some(mesh, 1 + random.below(30), random);
      next = current->tree->refit(mesh, vertices).value();
    }
    auto version = std::make_shared<const Version>(Version{mesh, std::move(next)});
    const std::lock_guard lock(mutex);
    current.swap(version);
  }
  done = true;
  reader.join();
  EXPECT_EQ(torn, 0) << "of " << read << ", seed " << seed;
}

TEST(WideRefit, a_patch_of_a_tree_with_parts_of_triangles_is_the_refit_of_everything) {
  const std::uint64_t seed = test::seed_or(64);
  Random random(seed);
  // Long needles among small triangles: what is split.
  TriangleMesh mesh = test::soup(3000, seed, 0.02F);
  for (int i = 0; i < 3000; ++i) {
    const Vec3f from(random.in_box(1.0)), to(random.in_box(1.0)), width(random.in_box(0.002));
    const auto needle = std::uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {from, to, to + width});
    mesh.triangles.push_back({needle, needle + 1, needle + 2});
  }
  const auto split = [&] { return WideBvh::build(mesh, {.spatial = SpatialSplits::kAuto}, {}).value(); };
  const Tree first = split();
  Tree patched = split();
  StructureStats stats;
  first->add_stats(stats);
  ASSERT_GT(stats.reference_count, mesh.triangle_count());
  for (int step = 0; step < 5; ++step) {
    const auto vertices = move_some(mesh, 3, random);
    patched = patched->refit(mesh, vertices).value();
    ASSERT_TRUE(patched->validate(mesh).ok()) << "step " << step << ", seed " << seed;
    ASSERT_NO_FATAL_FAILURE(expect_same(*first->refit(mesh).value(), *patched)) << "step " << step;
  }
}

TEST(WideRefit, a_patch_of_vertices_that_the_mesh_does_not_have_is_refused) {
  const auto mesh = std::make_shared<const TriangleMesh>(test::jittered_icosphere(4, 1));
  const Blas blas = Blas::build(mesh, {.kind = StructureKind::kWideBvh}).value();
  const auto beyond = std::uint32_t(mesh->positions.size());
  EXPECT_TRUE(blas.refit(mesh, std::vector<std::uint32_t>{0, beyond - 1, 0}).ok());
  const auto refused = blas.refit(mesh, std::vector<std::uint32_t>{0, beyond});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(refused.error().where, "/vertices/1");
}

TEST(WideRefit, the_bits_do_not_depend_on_the_number_of_threads) {
  const TriangleMesh mesh = large_mesh(7), moved = test::translated(mesh, Vec3f(0.3F));
  Tree one, four;
  oneapi::tbb::task_arena(1).execute([&] { one = built(mesh)->refit(moved).value(); });
  oneapi::tbb::task_arena(4).execute([&] { four = built(mesh)->refit(moved).value(); });
  expect_same(*one, *four);
}

TEST(WideRefit, a_tree_that_collapsed_has_a_cost_and_comes_back) {
  const TriangleMesh mesh = test::jittered_icosphere(4, 9);
  const Tree first = built(mesh);
  for (const Vec3f& keep : {Vec3f(1, 1, 0), Vec3f(1, 0, 0), Vec3f(0, 0, 0)}) {
    TriangleMesh flat = mesh;
    for (Vec3f& p : flat.positions) p *= keep;
    const Tree collapsed = first->refit(flat).value();
    EXPECT_TRUE(collapsed->validate(flat).ok());
    EXPECT_TRUE(std::isfinite(cost_of(*collapsed)));
    EXPECT_GE(cost_of(*collapsed), 2.0);
    expect_same(*first, *collapsed->refit(mesh).value());
  }
}

}  // namespace
}  // namespace gridcast::blas
