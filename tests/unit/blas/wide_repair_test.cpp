// Selective repair of the wide tree: what is damaged is built anew, what is not stays, and the result is a
// tree like any other.

#include "core/blas/wide_repair.h"

#include <cstring>
#include <functional>

#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include "core/blas/wide_cost.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

using Tree = std::shared_ptr<const WideBvh>;

Tree built(const TriangleMesh& mesh) {
  return WideBvh::build(mesh, {.spatial = SpatialSplits::kNever}, {}).value();
}

Blas blas_of(const TriangleMesh& mesh) {
  return Blas::build(test::share(mesh), {.kind = StructureKind::kWideBvh, .spatial = SpatialSplits::kNever})
      .value();
}

/// 20,480 triangles, no two of which share a vertex.
const TriangleMesh& sphere() {
  static const TriangleMesh mesh = [] {
    const TriangleMesh closed = test::jittered_icosphere(5, 3);
    TriangleMesh apart;
    for (std::uint32_t id = 0; id < closed.triangle_count(); ++id) {
      for (const Vec3f& corner : closed.corners(id)) apart.positions.push_back(corner);
      apart.triangles.push_back({3 * id, 3 * id + 1, 3 * id + 2});
    }
    return apart;
  }();
  return mesh;
}

Vec3f center_of(const TriangleMesh& mesh, std::uint32_t id) {
  const auto corners = mesh.corners(id);
  return (corners[0] + corners[1] + corners[2]) / 3.F;
}

/// The triangles of `mesh`, a deformed sphere(), within `radius` of the pole change places among each other.
TriangleMesh exploded(TriangleMesh mesh, float radius, std::uint64_t seed = 1) {
  std::vector<std::uint32_t> patch;
  std::vector<Vec3f> places;
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    if (glm::length(center_of(mesh, id) - Vec3f(0, 1, 0)) >= radius) continue;
    patch.push_back(id);
    places.push_back(center_of(mesh, id));
  }
  Random random(seed);
  for (std::size_t i = 0; i < patch.size(); ++i) {
    std::swap(places[i], places[i + random.below(std::uint32_t(patch.size() - i))]);
    const Vec3f way = places[i] - center_of(mesh, patch[i]);
    for (const std::uint32_t vertex : mesh.triangles[patch[i]]) mesh.positions[vertex] += way;
  }
  return mesh;
}

TriangleMesh moved(TriangleMesh mesh, const std::function<Vec3f(Vec3f)>& move) {
  for (Vec3f& p : mesh.positions) p = move(p);
  return mesh;
}

Vec3f twisted(Vec3f p, float angle) {
  const float a = angle * p.y;
  return {std::cos(a) * p.x - std::sin(a) * p.z, p.y, std::sin(a) * p.x + std::cos(a) * p.z};
}

double cost_of(const WideBvh& tree) {
  StructureStats stats;
  tree.add_stats(stats);
  return stats.cost;
}

WideRepair repaired(const Tree& tree, const TriangleMesh& mesh) {
  return tree->repair(mesh, {}).value();
}

void expect_same_bits(const WideBvh& a, const WideBvh& b) {
  ASSERT_EQ(a.nodes().size(), b.nodes().size());
  ASSERT_EQ(a.blocks().size(), b.blocks().size());
  EXPECT_EQ(0, std::memcmp(a.nodes().data(), b.nodes().data(), a.nodes().size() * sizeof(WideNode)));
  EXPECT_EQ(0, std::memcmp(a.blocks().data(), b.blocks().data(), a.blocks().size() * sizeof(TriangleBlock)));
  EXPECT_EQ(cost_of(a), cost_of(b));
}

TEST(WideRepair, a_patch_that_exploded_is_repaired_to_nearly_the_cost_of_a_new_tree) {
  const TriangleMesh bad = exploded(sphere(), 0.4F);
  const Blas refitted = blas_of(sphere()).refit(test::share(bad)).value();
  const double fresh = blas_of(bad).stats().cost;
  ASSERT_GT(refitted.stats().cost, 1.3 * fresh);

  const Repair repair = refitted.repair().value();
  EXPECT_EQ(repair.outcome, RepairOutcome::kRepaired);
  EXPECT_LT(repair.cost_after, 1.1 * fresh);
  EXPECT_EQ(repair.cost_before, refitted.stats().cost);
  EXPECT_EQ(repair.cost_after, repair.blas.stats().cost);
  EXPECT_GT(repair.subtrees, 0U);
  EXPECT_LT(repair.triangles, bad.triangle_count() / 8) << "4 % are damaged";
  const Status status = repair.blas.validate();
  EXPECT_TRUE(status.ok()) << status.error().where << " " << status.error().message;
  EXPECT_EQ(repair.blas.bounds(), refitted.bounds());
  EXPECT_EQ(repair.blas.repair().value().outcome, RepairOutcome::kUnneeded) << "once is enough";
}

// A patch that stays within its box, but in which triangles become as large as itself, and one whose
// triangles stay as they are, but whose box grows: either way of measuring sees only one of them.
TEST(WideRepair, damage_is_seen_by_the_box_or_by_the_triangles) {
  TriangleMesh large = test::jittered_icosphere(5, 3);
  const Blas closed = blas_of(large);
  std::vector<std::uint32_t> patch;
  for (std::uint32_t v = 0; v < large.positions.size(); ++v)
    if (large.positions[v].y > 0.95F) patch.push_back(v);
  Random random(5);
  for (std::size_t i = patch.size(); i > 1; --i)
    std::swap(large.positions[patch[i - 1]], large.positions[patch[random.below(std::uint32_t(i))]]);
  EXPECT_EQ(closed.refit(test::share(large)).value().repair().value().outcome, RepairOutcome::kRepaired);

  TriangleMesh apart = sphere();
  for (std::uint32_t id = 0; id < apart.triangle_count(); ++id) {
    if (center_of(apart, id).y < 0.95F) continue;
    const Vec3f way(random.in_box(1.0));
    for (const std::uint32_t vertex : apart.triangles[id]) apart.positions[vertex] += way;
  }
  EXPECT_EQ(blas_of(sphere()).refit(test::share(apart)).value().repair().value().outcome,
            RepairOutcome::kRepaired);
}

TEST(WideRepair, a_tree_that_moved_grew_or_turned_as_a_whole_needs_none) {
  const Tree tree = built(sphere());
  const std::function<Vec3f(Vec3f)> moves[] = {
      [](Vec3f p) { return p; }, [](Vec3f p) { return p + Vec3f(5, 0, -3); },
      [](Vec3f p) { return 100.F * p; }, [](Vec3f p) { return Vec3f(p.z, -p.x, p.y); },
      [](Vec3f p) { return Vec3f(p.x, 2.F * p.y, p.z); }};
  for (const auto& move : moves) {
    const TriangleMesh mesh = moved(sphere(), move);
    const WideRepair repair = repaired(tree->refit(mesh).value(), mesh);
    EXPECT_EQ(repair.outcome, RepairOutcome::kUnneeded);
    EXPECT_EQ(repair.triangles, 0U);
    EXPECT_EQ(repair.tree, nullptr);
  }
  EXPECT_EQ(repaired(tree, sphere()).outcome, RepairOutcome::kUnneeded) << "as built";
  EXPECT_EQ(repaired(built({}), {}).outcome, RepairOutcome::kUnneeded) << "empty";
}

TEST(WideRepair, damage_everywhere_asks_for_a_whole_build) {
  const TriangleMesh mesh = exploded(sphere(), 10.F);
  const Blas refitted = blas_of(sphere()).refit(test::share(mesh)).value();
  const Repair repair = refitted.repair().value();
  EXPECT_EQ(repair.outcome, RepairOutcome::kRebuild);
  EXPECT_EQ(repair.cost_after, refitted.stats().cost);
  EXPECT_GT(double(repair.triangles), kMaxRepairShare * double(mesh.triangle_count()));
}

TEST(WideRepair, what_it_makes_does_not_depend_on_the_number_of_threads) {
  const TriangleMesh bad = exploded(sphere(), 0.4F);
  std::vector<WideRepair> repairs;
  for (int threads = 1; threads <= 4; ++threads)
    oneapi::tbb::task_arena(threads).execute(
        [&] { repairs.push_back(repaired(built(sphere())->refit(bad).value(), bad)); });
  for (const WideRepair& repair : repairs) {
    ASSERT_EQ(repair.outcome, RepairOutcome::kRepaired);
    expect_same_bits(*repairs[0].tree, *repair.tree);
    EXPECT_EQ(repairs[0].fresh_cost, repair.fresh_cost);
  }
}

TEST(WideRepair, the_result_has_no_gaps_and_its_boxes_and_costs_are_those_of_its_shape) {
  const TriangleMesh bad = exploded(sphere(), 0.4F);
  const Tree tree = repaired(built(sphere())->refit(bad).value(), bad).tree;
  ASSERT_NE(tree, nullptr);
  std::size_t blocks = 0;
  for (const WideNode& node : tree->nodes())
    for (std::uint32_t slot = 0; slot < node.slots; ++slot)
      if (wide_child::is_leaf(node.child[slot])) blocks += wide_child::block_count(node.child[slot]);
  EXPECT_EQ(blocks, tree->blocks().size());
  const auto costs = part_costs(tree->nodes(), WideParts(tree->nodes()));
  EXPECT_TRUE(std::equal(costs.begin(), costs.end(), tree->part_costs().begin(), tree->part_costs().end()));
  // Drawn anew over the same vertices, and away and back.
  expect_same_bits(*tree, *tree->refit(bad).value());
  const TriangleMesh away = moved(bad, [](Vec3f p) { return twisted(p, 1.F); });
  const Tree there = tree->refit(away).value();
  EXPECT_TRUE(there->validate(away).ok());
  expect_same_bits(*tree, *there->refit(bad).value());
}

TEST(WideRepair, patches_of_a_repaired_tree_are_bit_for_bit_its_refits) {
  const std::uint64_t seed = test::seed_or(71);
  Random random(seed);
  TriangleMesh mesh = exploded(sphere(), 0.4F);
  const Tree first = repaired(built(sphere())->refit(mesh).value(), mesh).tree;
  Tree patched = repaired(built(sphere())->refit(mesh).value(), mesh).tree;
  for (int step = 0; step < 10; ++step) {
    std::vector<std::uint32_t> vertices;
    for (int i = 0; i < 8; ++i) vertices.push_back(random.below(std::uint32_t(mesh.positions.size())));
    for (const std::uint32_t v : vertices) mesh.positions[v] += Vec3f(random.in_box(0.1));
    patched = patched->refit(mesh, vertices).value();
    ASSERT_TRUE(patched->validate(mesh).ok()) << "step " << step << ", seed " << seed;
    expect_same_bits(*first->refit(mesh).value(), *patched);
  }
}

TEST(WideRepair, parts_that_stay_are_still_compared_with_what_they_were_when_built) {
  // Everything is a little worse, which does not pay, and a patch is much worse.
  const TriangleMesh turned = moved(sphere(), [](Vec3f p) { return twisted(p, 1.2F); });
  const Blas start = blas_of(sphere());
  ASSERT_EQ(start.refit(test::share(turned)).value().repair().value().outcome, RepairOutcome::kUnneeded);
  const Repair repair = start.refit(test::share(exploded(turned, 0.4F))).value().repair().value();
  ASSERT_EQ(repair.outcome, RepairOutcome::kRepaired);
  const StructureStats& stats = repair.blas.stats();
  EXPECT_LT(stats.cost_at_build, 0.97 * stats.cost) << "not as good as new";
  EXPECT_DOUBLE_EQ(stats.looseness_at_build / stats.looseness, stats.cost_at_build / stats.cost);
  // Back where every part was built: as good as then, but for the patch.
  const StructureStats back = repair.blas.refit(test::share(exploded(sphere(), 0.4F))).value().stats();
  EXPECT_LT(back.cost, stats.cost);
}

TEST(WideRepair, damage_after_damage_is_repaired_frame_after_frame) {
  TriangleMesh mesh = sphere();
  Blas blas = blas_of(mesh);
  for (std::uint64_t frame = 0; frame < 6; ++frame) {
    // Another place each time: the sphere rolls.
    mesh = exploded(moved(mesh, [](Vec3f p) { return Vec3f(p.y, p.z, p.x); }), 0.35F, frame);
    const Repair repair = blas.refit(test::share(mesh)).value().repair().value();
    ASSERT_NE(repair.outcome, RepairOutcome::kRebuild) << "frame " << frame;
    ASSERT_TRUE(repair.blas.validate().ok()) << "frame " << frame;
    EXPECT_LT(repair.cost_after, 1.2 * blas_of(mesh).stats().cost) << "frame " << frame;
    blas = repair.blas;
  }
}

TEST(WideRepair, a_tree_built_over_points_is_left_alone) {
  const TriangleMesh point = moved(sphere(), [](Vec3f) { return Vec3f(1, 2, 3); });
  const Tree tree = built(point);
  EXPECT_EQ(repaired(tree, point).outcome, RepairOutcome::kUnneeded);
  EXPECT_EQ(repaired(tree->refit(sphere()).value(), sphere()).outcome, RepairOutcome::kUnneeded);
}

TEST(WideRepair, structures_without_it_and_a_stop_are_errors) {
  const auto mesh = test::share(exploded(sphere(), 0.4F));
  for (const StructureKind kind : {StructureKind::kBvh, StructureKind::kCompactBvh, StructureKind::kKdTree,
                                   StructureKind::kBruteForce}) {
    const auto refused = Blas::build(mesh, {.kind = kind}).value().repair();
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kUnsupported);
  }
  // Long needles among small triangles: what is split.
  TriangleMesh needles = test::soup(3000, 64, 0.02F);
  Random random(64);
  for (int i = 0; i < 3000; ++i) {
    const Vec3f from(random.in_box(1.0)), to(random.in_box(1.0)), width(random.in_box(0.002));
    const auto needle = std::uint32_t(needles.positions.size());
    needles.positions.insert(needles.positions.end(), {from, to, to + width});
    needles.triangles.push_back({needle, needle + 1, needle + 2});
  }
  const Blas split = Blas::build(test::share(needles), {.kind = StructureKind::kWideBvh}).value();
  ASSERT_GT(split.stats().reference_count, needles.triangle_count());
  EXPECT_EQ(split.repair().error().code, ErrorCode::kUnsupported);

  std::stop_source stop;
  stop.request_stop();
  const auto stopped = blas_of(sphere()).refit(mesh).value().repair(stop.get_token());
  ASSERT_FALSE(stopped.ok());
  EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::blas
