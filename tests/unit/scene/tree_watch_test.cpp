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

blas::StructureStats stats(double cost, double looseness, std::size_t triangles = 100) {
  blas::StructureStats made;
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
  EXPECT_EQ(rebuilt_as(kFastRebuildTriangles, BuildQuality::kDefault), BuildQuality::kDefault);
  EXPECT_EQ(rebuilt_as(kFastRebuildTriangles, BuildQuality::kFast), BuildQuality::kFast);
  EXPECT_EQ(rebuilt_as(kLarge, BuildQuality::kDefault), BuildQuality::kFast);
  EXPECT_NE(judge_refit(stats(99.0, 4.0, kLarge), kAlone).reason.find("Morton"), std::string::npos);
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
    data.instances.push_back({.name = {}, .mesh_id = 0, .world_from_object = {}});
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
                            {.kind = scene->blas(0).stats().kind, .spatial = blas::SpatialSplits::kNever})
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
  data.instances.push_back({.name = {}, .mesh_id = 0, .world_from_object = {}});
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
      blas::Blas::build(tree.mesh_ptr(), {.kind = tree.stats().kind, .spatial = blas::SpatialSplits::kNever})
          .value();
  EXPECT_LT(tree.stats().cost, 1.3 * fresh.stats().cost);
  EXPECT_TRUE(updated.scene->validate().ok());
}

}  // namespace
}  // namespace gridcast::scene
