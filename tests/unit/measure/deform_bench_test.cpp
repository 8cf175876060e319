#include <algorithm>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "core/measure/bench.h"
#include "core/measure/deform_summary.h"
#include "core/measure/deformation_set.h"

namespace gridcast::measure {
namespace {

DeformRow row(std::size_t frame, double vs_fresh, double embree, const char* action) {
  DeformRow made;
  made.scene = "S1";
  made.deformation = "twist";
  made.frame = frame;
  made.action = action;
  made.update_ms = 10.0 * double(frame);
  made.vs_fresh = vs_fresh;
  made.embree_refit_vs_fresh = embree;
  return made;
}

TEST(DeformSummary, WorstIsOfAllFramesAndSteadyOfTheLastThird) {
  const DeformSummaryRow sum =
      summary_of({row(1, 1.0, 2.0, "refit"), row(2, 2.5, 3.0, "rebuild"), row(3, 1.1, 9.0, "refit"),
                  row(4, 1.2, 4.0, "rebuild"), row(5, 1.3, 5.0, "refit"), row(6, 1.7, 6.0, "refit")},
                 99);
  EXPECT_EQ(sum.deformation, "twist");
  EXPECT_EQ(sum.triangles, 99U);
  EXPECT_EQ(sum.frames, 6U);
  EXPECT_EQ(sum.rebuilds, 2U);
  EXPECT_EQ(sum.worst_vs_fresh, 2.5);
  EXPECT_EQ(sum.worst_frame, 2U);
  EXPECT_DOUBLE_EQ(sum.steady_vs_fresh, 1.5);
  EXPECT_EQ(sum.embree_worst_vs_fresh, 9.0);
  EXPECT_DOUBLE_EQ(sum.embree_steady_vs_fresh, 5.5);
  EXPECT_EQ(sum.median_update_ms, 35.0);
  EXPECT_EQ(sum.worst_update_ms, 60.0);
}

TEST(DeformSummary, AllIsTheWorstOfItsParts) {
  DeformSummaryRow a = summary_of({row(1, 2.0, 7.0, "rebuild")}, 5);
  DeformSummaryRow b = summary_of({row(1, 1.2, 8.0, "refit"), row(2, 1.4, 6.0, "refit")}, 5);
  const DeformSummaryRow all = worst_of({a, b});
  EXPECT_EQ(all.deformation, "all");
  EXPECT_EQ(all.frames, 3U);
  EXPECT_EQ(all.rebuilds, 1U);
  EXPECT_EQ(all.worst_vs_fresh, 2.0);
  EXPECT_EQ(all.steady_vs_fresh, 2.0);
  EXPECT_EQ(all.embree_worst_vs_fresh, 8.0);
  EXPECT_EQ(all.embree_steady_vs_fresh, 7.0);
}

TEST(DeformBench, EveryFrameOfEveryDeformationIsAskedAndAnsweredLikeAFreshScene) {
  BenchOptions options;
  options.rays = 200;
  options.repeat = 2;
  options.frames = 2;
  Report report;
  double last = 0.0;
  ASSERT_TRUE(bench_deformations(make_scene("S1", 1, 0.01).value(), options, report,
                                 [&](double fraction) { last = fraction; }));
  EXPECT_EQ(last, 1.0);
  ASSERT_EQ(report.deform.size(), 2 * kAllDeformations.size());
  std::map<std::string, int> actions;
  for (const DeformRow& made : report.deform) {
    SCOPED_TRACE(made.deformation + ' ' + std::to_string(made.frame));
    ++actions[made.action];
    EXPECT_GT(made.vs_fresh, 0.0);
    EXPECT_GT(made.cost_ratio, 0.0);
    EXPECT_GT(made.fresh_ns_per_ray, 0.0);
    EXPECT_GT(std::min({made.update_ms, made.embree_update_ms, made.embree_build_ms}), 0.0);
  }
  EXPECT_GT(actions["refit"], 0);
  EXPECT_GT(actions["rebuild"], 0);
  ASSERT_EQ(report.deform_summary.size(), kAllDeformations.size() + 1);
  EXPECT_EQ(report.deform_summary.back().deformation, "all");
  ASSERT_EQ(report.checks.size(), kAllDeformations.size());
  for (const CheckRow& check : report.checks) {
    EXPECT_EQ(check.rays, 200U * 2 * 3);
    EXPECT_EQ(check.differs, 0U) << check.set;
    // Half of the rays are aimed at triangles, which have no area when they are in a line.
    EXPECT_TRUE(check.hits > check.rays / 3 || check.set == "collapse_line") << check.set;
  }
}

TEST(DeformBench, StopsWhenTold) {
  std::stop_source stop;
  BenchOptions options;
  options.rays = 50;
  options.frames = 3;
  options.stop = stop.get_token();
  Report report;
  const Status status = bench_deformations(make_scene("S1", 1, 0.01).value(), options, report,
                                           [&](double) { stop.request_stop(); });
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kCancelled);
  EXPECT_TRUE(report.deform_summary.empty());
}

}  // namespace
}  // namespace gridcast::measure
