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

TEST(TreeWatch, a_tree_goes_when_either_measure_exceeds_the_limit) {
  EXPECT_FALSE(judge_refit(stats(15.0, 6.0), BuildQuality::kDefault).rebuild_as);
  EXPECT_FALSE(judge_refit(stats(1.0, 0.1), BuildQuality::kDefault).rebuild_as);
  EXPECT_TRUE(judge_refit(stats(15.1, 4.0), BuildQuality::kDefault).rebuild_as);
  EXPECT_TRUE(judge_refit(stats(10.0, 6.1), BuildQuality::kDefault).rebuild_as);
  EXPECT_EQ(worsening(stats(20.0, 4.0)), 2.0);
  EXPECT_EQ(worsening(stats(10.0, 12.0)), 3.0);
}

TEST(TreeWatch, unknown_measures_condemn_nothing) {
  blas::StructureStats unknown;
  EXPECT_EQ(worsening(unknown), 1.0);
  EXPECT_FALSE(judge_refit(unknown, BuildQuality::kDefault).rebuild_as);
}

TEST(TreeWatch, large_meshes_are_rebuilt_fast_and_small_ones_as_asked) {
  EXPECT_EQ(judge_refit(stats(99.0, 4.0, kFastRebuildTriangles), BuildQuality::kDefault).rebuild_as,
            BuildQuality::kDefault);
  EXPECT_EQ(judge_refit(stats(99.0, 4.0, kFastRebuildTriangles), BuildQuality::kFast).rebuild_as,
            BuildQuality::kFast);
  const TreeVerdict large = judge_refit(stats(99.0, 4.0, kFastRebuildTriangles + 1), BuildQuality::kDefault);
  EXPECT_EQ(large.rebuild_as, BuildQuality::kFast);
  EXPECT_NE(large.reason.find("Morton"), std::string::npos);
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

}  // namespace
}  // namespace gridcast::scene
