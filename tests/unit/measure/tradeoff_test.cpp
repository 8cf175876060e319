#include "core/measure/tradeoff.h"

#include <algorithm>
#include <atomic>

#include <gtest/gtest.h>

#include "core/scene/flatten.h"
#include "core/scene/trace.h"
#include "core/scene/update.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::measure {
namespace {

scene::SceneData row_of(mesh::TriangleMesh mesh, int instances) {
  scene::SceneData data;
  data.meshes.push_back(test::share(std::move(mesh)));
  data.deformations.resize(1);
  test::Random random(17);
  for (int i = 0; i < instances; ++i) {
    const double angle = random.uniform(0.0, 6.0), c = std::cos(angle), s = std::sin(angle);
    data.instances.push_back({{}, {Mat3d{{c, s, 0}, {-s, c, 0}, {0, 0, 1}}, Vec3d(2.5 * i, 0.0, 1e3)}, 0});
  }
  return data;
}

TradeoffOptions tiny_options() {
  TradeoffOptions options;
  options.accuracy_rays = 600;
  options.speed_rays = 100;
  options.repeat = 1;
  options.seed = test::seed_or(4711);
  return options;
}

TEST(Tradeoff, EveryMethodHasARowInEveryClass) {
  std::atomic<double> progress = 0.0;
  const auto report =
      measure_tradeoffs(row_of(test::jittered_icosphere(2, 5), 3), tiny_options(),
                        [&](double fraction) { progress = std::max(progress.load(), fraction); });
  ASSERT_TRUE(report) << report.error().message;
  // Six structures in three precisions, and two of Embree.
  EXPECT_EQ(report->rows.size(), 20U * kAllRayClasses.size());
  EXPECT_EQ(report->closed_meshes, 1U);
  EXPECT_DOUBLE_EQ(progress.load(), 1.0);
  for (const RayClass ray_class : kAllRayClasses)
    EXPECT_TRUE(std::ranges::any_of(
        report->rows, [&](const TradeoffRow& row) { return row.ray_class == ray_class && row.on_front; }));
  for (const TradeoffRow& row : report->rows) {
    SCOPED_TRACE(row.structure + " " + row.precision + " " + std::string(to_string(row.ray_class)));
    EXPECT_GT(row.mrays_per_s, 0.0);
    EXPECT_EQ(row.accuracy.rays, 600U);
    EXPECT_EQ(row.image_difference.of, 128U * 128U);
    const bool is_any = row.ray_class == RayClass::kShadow;
    EXPECT_EQ(row.accuracy.covered.known(), row.engine == "gridcast" && !is_any);
    EXPECT_EQ(row.accuracy.covered.count, row.accuracy.covered.of) << "every bound covers the error";
    EXPECT_EQ(row.accuracy.t_error_ulp.has_value(), !is_any);
  }
}

TEST(Tradeoff, InstancesThatCannotBeHitAreNotCounted) {
  scene::SceneData data = row_of(test::icosphere(0), 3);
  data.instances[1].world_from_object = {Mat3d(0.0), Vec3d(0.0)};
  TradeoffOptions options = tiny_options();
  options.classes = {RayClass::kRandom};
  const auto report = measure_tradeoffs(data, options, {});
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(report->instances, 2U);
  EXPECT_EQ(report->world_triangles, 40U);
  EXPECT_EQ(report->stored_triangles, 20U);
}

/// The property that the mode is named for: nothing differs, not even in a tie.
TEST(Tradeoff, ExactModeHasNoErrorOfAnyKindAndRobustModeNoLeak) {
  TradeoffOptions options = tiny_options();
  options.accuracy_rays = 3000;
  options.precisions = {Precision::kRobust, Precision::kExact};
  for (scene::SceneData data : {row_of(test::jittered_icosphere(2, 9), 4), row_of(test::needle_fan(90), 3),
                                row_of(test::repeated(test::voxel_boundary(4, 3), 2), 2)}) {
    const auto report = measure_tradeoffs(data, options, {});
    ASSERT_TRUE(report) << report.error().message;
    for (const TradeoffRow& row : report->rows) {
      if (row.engine != "gridcast") continue;
      SCOPED_TRACE(row.structure + " " + row.precision + " " + std::string(to_string(row.ray_class)));
      const Accuracy& found = row.accuracy;
      EXPECT_EQ(found.leaks.count, 0U);
      if (row.precision != "exact") continue;
      EXPECT_EQ(found.errors().count, 0U);
      EXPECT_EQ(found.ties.count + found.neighbours.count, 0U);
      EXPECT_EQ(row.image_difference.count, 0U);
      EXPECT_TRUE(row.ray_class != RayClass::kVertex || found.leaks.of > 500U);
    }
  }
}

TEST(Tradeoff, OpenMeshesHaveNoLeaks) {
  TradeoffOptions options = tiny_options();
  options.classes = {RayClass::kRandom, RayClass::kEdge};
  const auto report = measure_tradeoffs(row_of(test::quad_grid(6), 2), options, {});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->closed_meshes, 0U);
  for (const TradeoffRow& row : report->rows) EXPECT_FALSE(row.accuracy.leaks.known());
}

TEST(Tradeoff, BruteForceIsForSmallScenesAlone) {
  TradeoffOptions options = tiny_options();
  options.classes = {RayClass::kRandom};
  options.precisions = {Precision::kRobust};
  const auto has_brute_force = [](const TradeoffReport& report) {
    return std::ranges::any_of(report.rows,
                               [](const TradeoffRow& row) { return row.structure == "brute_force"; });
  };
  const auto small = measure_tradeoffs(row_of(test::icosphere(2), 1), options, {});
  const auto large = measure_tradeoffs(row_of(test::icosphere(4), 1), options, {});
  ASSERT_TRUE(small && large);
  EXPECT_TRUE(has_brute_force(*small));
  EXPECT_TRUE(small->notes.empty());
  EXPECT_FALSE(has_brute_force(*large));
  EXPECT_EQ(large->notes.size(), 1U);
  options.structures = {blas::StructureKind::kBruteForce};
  const auto none = measure_tradeoffs(row_of(test::icosphere(4), 1), options, {});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().where, "/structures");
}

TEST(Tradeoff, NothingToHitAndAStopAreErrors) {
  const auto empty = measure_tradeoffs({}, tiny_options(), {});
  ASSERT_FALSE(empty);
  EXPECT_EQ(empty.error().code, ErrorCode::kInvalidArgument);
  // Stopped at every tenth of the way.
  for (double at = 0.0; at < 0.95; at += 0.1) {
    std::stop_source stop;
    TradeoffOptions options = tiny_options();
    options.structures = {blas::StructureKind::kWideBvh};
    options.stop = stop.get_token();
    const auto stopped = measure_tradeoffs(row_of(test::icosphere(2), 2), options, [&](double fraction) {
      if (fraction >= at) stop.request_stop();
    });
    ASSERT_FALSE(stopped) << at;
    EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
  }
}

TEST(Tradeoff, FlattenedScenesKeepIdsAndAnswers) {
  const auto first = scene::build_scene(row_of(test::icosphere(1), 4)).value();
  const auto changed = scene::apply_update(*first, {scene::RemoveInstance{1}}).value().scene;
  const auto again = scene::build_scene(flattened(*changed)).value();
  EXPECT_EQ(again->instance_slots(), 4U);
  for (int i = 0; i < 4; ++i) {
    const Ray ray{{2.5 * i, 0.0, 990.0}, {0.01, 0.02, 1.0}};
    const SurfaceHit a = scene::intersect(*changed, ray), b = scene::intersect(*again, ray);
    EXPECT_EQ(a.status, i == 1 ? RayStatus::kMiss : RayStatus::kHit);
    EXPECT_EQ(a.status, b.status);
    EXPECT_EQ(a.t, b.t);
    EXPECT_EQ(a.instance_id, b.instance_id);
  }
}

}  // namespace
}  // namespace gridcast::measure
