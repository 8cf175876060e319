#include <algorithm>

#include <gtest/gtest.h>

#include "core/measure/answers.h"
#include "core/measure/bench.h"

namespace gridcast::measure {
namespace {

BenchOptions tiny_options() {
  BenchOptions options;
  options.rays = 600;
  options.repeat = 2;
  return options;
}

std::size_t count(const Report& report, auto&& wanted) {
  return std::size_t(std::count_if(report.rays.begin(), report.rays.end(), wanted));
}

TEST(RaysBench, EveryContenderGetsARowAndOursAgree) {
  BenchOptions options = tiny_options();
  options.sets = {RaySetKind::kPrimary, RaySetKind::kAo};
  Report report;
  ASSERT_TRUE(bench_rays(make_scene("S1", 2, 0.02).value(), options, report, {}));
  // Three structures, two precisions, single and batch, two sets.
  EXPECT_EQ(count(report, [](const RayRow& row) { return row.engine == "gridcast"; }), 24U);
  EXPECT_EQ(count(report, [](const RayRow& row) { return row.entry == "packet16_coherent"; }), 2U);
  for (const RayRow& row : report.rays) {
    EXPECT_GT(row.mrays_per_s, 0.0);
    EXPECT_GT(row.vs_embree_default, 0.0);
    EXPECT_GT(row.vs_embree_robust, 0.0);
  }
  EXPECT_EQ(report.checks.size(), 24U);
  for (const CheckRow& row : report.checks) {
    EXPECT_EQ(row.rays, 600U);
    EXPECT_GT(row.brute_force_rays, 100U);
  }
  EXPECT_EQ(wrong_answers(report), 0U);
}

TEST(RaysBench, OurHitsAreEmbreesButForAFewAtEdges) {
  for (const char* name : {"S2", "S4", "I1", "W3"}) {
    SCOPED_TRACE(name);
    BenchOptions options = tiny_options();
    options.structures = {blas::StructureKind::kWideBvh};
    options.precisions = {Precision::kRobust};
    options.repeat = 1;
    Report report;
    ASSERT_TRUE(bench_rays(make_scene(name, 2, 0.01).value(), options, report, {}));
    for (const CheckRow& row : report.checks) {
      SCOPED_TRACE(row.set);
      EXPECT_LT(row.embree_differs, 12U);
    }
  }
}

TEST(RaysBench, ADifferenceIsCounted) {
  Answers a, b;
  a.resize(4, QueryKind::kClosest);
  b = a;
  EXPECT_EQ(count_differences(a, b), 0U);
  // The smallest change there is, and -0 for 0: equal as numbers, not as bits.
  b.hits.t[2] = 1.0;
  b.hits.uv[1] = -0.F;
  EXPECT_EQ(count_differences(a, b), 2U);
  Report report;
  report.checks.emplace_back().differs = 2;
  EXPECT_EQ(wrong_answers(report), 2U);
}

TEST(RaysBench, AStoppedBenchmarkSaysSo) {
  std::stop_source stop;
  stop.request_stop();
  BenchOptions options = tiny_options();
  options.stop = stop.get_token();
  Report report;
  const Status status = bench_rays(make_scene("S1", 2, 0.01).value(), options, report, {});
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::measure
