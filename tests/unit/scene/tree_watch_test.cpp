#include "core/scene/tree_watch.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "core/scene/update.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::scene {
namespace {

using blas::BuildQuality;
using blas::SpatialSplits;

blas::StructureStats stats(double cost, double looseness, std::size_t triangles = 100) {
  blas::StructureStats made;
  made.kind = blas::StructureKind::kWideBvh;
  made.triangle_count = triangles;
  made.cost = cost;
  made.cost_at_build = 10.0;
  made.looseness = looseness;
  made.looseness_at_build = 4.0;
  return made;
}

constexpr TreeTerms kAlone{};
constexpr TreeTerms kServed{BuildQuality::kDefault, BuildQuality::kDefault, RebuildPlace::kInBackground};
constexpr std::size_t kLarge = kFastRebuildTriangles + 1;
constexpr std::size_t kHuge = kSharedRebuildTriangles + 1;
constexpr TreeForm kWhole{BuildQuality::kDefault, SpatialSplits::kNever};
constexpr TreeForm kMorton{BuildQuality::kFast, SpatialSplits::kNever};
constexpr TreeForm kShared{BuildQuality::kDefault, SpatialSplits::kAuto};

/// Of a refitted tree that is of no use, of whose mesh a random ray meets so many boxes of triangles.
blas::StructureStats useless(double boxes, std::size_t triangles) {
  return stats(1e6, 1e6 / boxes, triangles);
}

bool is_kept(const blas::StructureStats& refitted, const TreeTerms& terms) {
  return !judge_refit(refitted, terms).rebuild_as;
}

TEST(TreeWatch, a_tree_goes_when_either_measure_exceeds_the_limit) {
  EXPECT_TRUE(is_kept(stats(15.0, 6.0), kAlone));
  EXPECT_TRUE(is_kept(stats(1.0, 0.1), kAlone));
  EXPECT_FALSE(is_kept(stats(15.1, 4.0), kAlone));
  EXPECT_FALSE(is_kept(stats(10.0, 6.1), kAlone));
  EXPECT_EQ(worsening(stats(20.0, 4.0)), 2.0);
  EXPECT_EQ(worsening(stats(10.0, 12.0)), 3.0);
}

TEST(TreeWatch, unknown_measures_condemn_nothing) {
  blas::StructureStats unknown;
  EXPECT_EQ(worsening(unknown), 1.0);
  EXPECT_TRUE(is_kept(unknown, kAlone));
}

TEST(TreeWatch, large_meshes_are_rebuilt_fast_and_small_ones_as_asked) {
  const auto rebuilt_as = [](std::size_t triangles, BuildQuality asked) {
    return judge_refit(stats(99.0, 4.0, triangles), {BuildQuality::kDefault, asked, RebuildPlace::kInUpdate})
        .rebuild_as;
  };
  EXPECT_EQ(rebuilt_as(kFastRebuildTriangles, BuildQuality::kDefault), kWhole);
  EXPECT_EQ(rebuilt_as(kFastRebuildTriangles, BuildQuality::kFast), kMorton);
  EXPECT_EQ(rebuilt_as(kLarge, BuildQuality::kDefault), kMorton);
  EXPECT_NE(judge_refit(stats(99.0, 4.0, kLarge), kAlone).reason.find("Morton"), std::string::npos);
}

TEST(TreeWatch, leaves_share_triangles_where_their_boxes_crowd_and_an_update_has_the_time) {
  for (const std::size_t triangles : {std::size_t(100), kLarge, kSharedRebuildTriangles}) {
    SCOPED_TRACE(triangles);
    EXPECT_EQ(quick_form(1.001 * kCrowdedBoxes, triangles, BuildQuality::kDefault), kShared);
    EXPECT_EQ(quick_form(1.001 * kCrowdedBoxes, triangles, BuildQuality::kFast), kMorton) << "not asked for";
    EXPECT_EQ(quick_form(kCrowdedBoxes, triangles, BuildQuality::kDefault),
              triangles == 100 ? kWhole : kMorton);
  }
  EXPECT_EQ(quick_form(1e6, kHuge, BuildQuality::kDefault), kMorton);
  EXPECT_EQ(best_form(1.001 * kCrowdedBoxes, BuildQuality::kDefault), kShared) << "of whatever size";
  EXPECT_EQ(best_form(kCrowdedBoxes, BuildQuality::kDefault), kWhole);
  EXPECT_EQ(best_form(1e6, BuildQuality::kFast), kMorton);
}

TEST(TreeWatch, a_verdict_says_how_the_tree_is_built_anew_and_why) {
  const auto says = [](const TreeVerdict& verdict, const char* words) {
    return verdict.reason.find(words) != std::string::npos;
  };
  const TreeVerdict shared = judge_refit(useless(5000.0, kLarge), kServed);
  EXPECT_EQ(shared.rebuild_as, kShared);
  EXPECT_TRUE(says(shared, "Leaves share triangles: a random ray meets the boxes of 5000 triangles."))
      << shared.reason;
  const TreeVerdict huge = judge_refit(useless(5000.0, kHuge), kServed);
  EXPECT_EQ(huge.rebuild_as, kMorton);
  EXPECT_TRUE(says(huge, "In Morton order: more than 1048576 triangles, too many to be shared"))
      << huge.reason;
  const TreeVerdict sparse = judge_refit(useless(50.0, kHuge), kServed);
  EXPECT_EQ(sparse.rebuild_as, kMorton);
  EXPECT_TRUE(says(sparse, "In Morton order: more than 16384 triangles.")) << sparse.reason;
  // A binary BVH has no leaves that share.
  blas::StructureStats binary = useless(5000.0, kLarge);
  binary.kind = blas::StructureKind::kBvh;
  EXPECT_EQ(judge_refit(binary, kServed).rebuild_as, kMorton);
}

TEST(TreeWatch, a_morton_tree_is_judged_by_the_cost_of_a_good_one) {
  for (TreeTerms terms : {kAlone, kServed}) {
    const double cost = 10.0 * kMaxRefitCostRatio / kMortonCostRatio;
    terms.built = BuildQuality::kFast;
    EXPECT_TRUE(is_kept(stats(0.999 * cost, 4.0, kLarge), terms));
    EXPECT_FALSE(is_kept(stats(1.001 * cost, 4.0, kLarge), terms));
    terms.asked = BuildQuality::kFast;
    EXPECT_TRUE(is_kept(stats(1.001 * cost, 4.0, kLarge), terms)) << "nothing better was asked for";
  }
}

/// The trees that an update leaves cost about what new ones do, through a shuffle of the vertices and back:
/// the way back costs no more than at build by the root's box, and would stay unnoticed by that measure.
TEST(TreeWatch, a_mesh_that_is_shuffled_and_put_in_order_again_keeps_a_good_tree) {
  for (const int level : {4, 6}) {  // below and above kFastRebuildTriangles
    SCOPED_TRACE(level);
    const auto mesh = test::share(test::icosphere(level));
    SceneData data;
    data.meshes = {mesh};
    data.deformations.resize(1);
    data.instances.push_back({.name = {}, .world_from_object = {}, .mesh_id = 0});
    auto scene = build_scene(std::move(data)).value();
    std::vector<Vec3f> shuffled = mesh->positions;
    std::mt19937_64 engine(test::seed_or(91));
    std::shuffle(shuffled.begin(), shuffled.end(), engine);
    for (const auto& positions : {shuffled, mesh->positions}) {
      const auto updated =
          apply_update(*scene, {ReplaceVertices{0, positions, {}, UpdateMode::kAuto}}).value();
      scene = updated.scene;
      EXPECT_EQ(updated.report.meshes[0].action, MeshAction::kRebuild) << updated.report.meshes[0].reason;
      const blas::Blas fresh =
          blas::Blas::build(scene->blas(0).mesh_ptr(),
                            {.kind = scene->blas(0).stats().kind, .spatial = SpatialSplits::kAuto})
              .value();
      EXPECT_LT(scene->blas(0).stats().cost, 1.3 * fresh.stats().cost);
      EXPECT_TRUE(scene->validate().ok());
    }
  }
}

/// Where a part of a large mesh flies apart, the tree is repaired there and stays elsewhere.
TEST(TreeWatch, a_large_mesh_that_breaks_in_one_place_is_repaired_there) {
  const auto mesh = test::share(test::icosphere(6));
  SceneData data;
  data.meshes = {mesh};
  data.deformations.resize(1);
  data.instances.push_back({.name = {}, .world_from_object = {}, .mesh_id = 0});
  const auto scene = build_scene(std::move(data)).value();
  std::vector<Vec3f> positions = mesh->positions;
  test::Random random(test::seed_or(92));
  for (Vec3f& p : positions)
    if (p.y > 0.93F) p += Vec3f(random.in_box(0.4));
  const auto updated = apply_update(*scene, {ReplaceVertices{0, positions, {}}}).value();
  const MeshUpdateReport& report = updated.report.meshes[0];
  EXPECT_EQ(report.action, MeshAction::kRefit);
  EXPECT_NE(report.reason.find("subtrees built anew"), std::string::npos) << report.reason;
  const blas::Blas& tree = updated.scene->blas(0);
  const blas::Blas fresh =
      blas::Blas::build(tree.mesh_ptr(), {.kind = tree.stats().kind, .spatial = SpatialSplits::kNever})
          .value();
  EXPECT_LT(tree.stats().cost, 1.3 * fresh.stats().cost);
  EXPECT_TRUE(updated.scene->validate().ok());
}

}  // namespace
}  // namespace gridcast::scene
