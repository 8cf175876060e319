// Answers with planted errors: each must be counted once, as what it is.

#include "core/measure/accuracy.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/measure/pareto.h"
#include "tests/support/exact_reference.h"
#include "tests/support/shapes.h"

namespace gridcast::measure {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Rate, ZeroOfManyIsABoundAndNotNothing) {
  const Rate some{3, 2000}, none{0, 20'000}, unknown{};
  EXPECT_DOUBLE_EQ(some.per_million(), 1500.0);
  EXPECT_DOUBLE_EQ(none.per_million(), 0.0);
  EXPECT_DOUBLE_EQ(none.below_per_million(), 150.0);
  EXPECT_FALSE(unknown.known());
}

TEST(Quantiles, AreValuesThatTheShareDoesNotExceed) {
  EXPECT_FALSE(quantiles_of({}));
  std::vector<double> values;
  for (int i = 100; i >= 1; --i) values.push_back(i);
  const Quantiles found = *quantiles_of(values);
  EXPECT_EQ(found.p50, 50.0);
  EXPECT_EQ(found.p99, 99.0);
  EXPECT_EQ(found.max, 100.0);
  EXPECT_EQ(quantiles_of({7.0})->p99, 7.0);
}

TEST(ParetoFront, HoldsWhatNothingBeats) {
  // The third is beaten by the second, the fourth by the first at equal errors; the last two are equal.
  const std::vector<TradeoffPoint> points{{4, 0}, {9, 50}, {8, 60}, {3, 0}, {10, 70}, {10, 70}};
  EXPECT_EQ(pareto_front(points), (std::vector<bool>{true, true, false, false, true, true}));
  EXPECT_TRUE(pareto_front({}).empty());
}

/// 0 and 1 are the same triangle at z = 0, 2 is its neighbour across the diagonal, 3 a large one at z = -1.
mesh::TriangleMesh layers() {
  mesh::TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {-9, -9, -1}, {9, -9, -1}, {0, 18, -1}};
  mesh.triangles = {{0, 1, 2}, {0, 1, 2}, {1, 3, 2}, {4, 5, 6}};
  return mesh;
}

class PlantedErrors : public ::testing::Test {
 protected:
  /// Rays 0 to 6 look down at triangle 0 from z = 1, so that t = 1; ray 7 passes by everything.
  PlantedErrors() : scene_(test::share(layers())) {
    rays_.kind = RaySetKind::kPrimaryShuffled;
    for (int i = 0; i < 8; ++i) {
      const float x = i == 7 ? 50.F : 0.25F;
      rays_.rows.push_back({x, 0.25F, 1.F, 0.F, 0.F, 0.F, -1.F, std::numeric_limits<float>::infinity()});
    }
    right_.hit.assign(8, 1);
    right_.t.assign(8, 1.0);
    right_.instance_id.assign(8, 0);
    right_.primitive_id.assign(8, 0);
    right_.t_error.assign(8, 0.0);
    right_.hit[7] = 0;
  }

  [[nodiscard]] Truth truth(std::vector<std::uint8_t> inside = {}) const {
    return Truth::find(*scene_.operator->(), rays_, std::move(inside), 10.0, {}, {}).value();
  }

  test::ExactScene scene_;
  RaySet rays_;
  ReportedHits right_;
};

TEST_F(PlantedErrors, NoneWhereAllIsRight) {
  const Accuracy found = truth().judge(right_);
  EXPECT_EQ(found.rays, 8U);
  for (const Rate& rate : {found.missed, found.false_hits, found.wrong, found.ties, found.neighbours}) {
    EXPECT_EQ(rate.count, 0U);
    EXPECT_EQ(rate.of, 8U);
  }
  EXPECT_FALSE(found.leaks.known()) << "no ray starts inside a closed mesh";
  EXPECT_EQ(found.t_error_ulp->max, 0.0);
  EXPECT_EQ(found.covered.count, 7U);
  EXPECT_EQ(found.covered.of, 7U);
  EXPECT_EQ(truth().other_primitive(right_).count, 0U);
}

TEST_F(PlantedErrors, EachIsCountedAsWhatItIs) {
  ReportedHits reported = right_;
  reported.hit[1] = 0;                                      // missed, and a leak
  reported.hit[7] = 1;                                      // false
  reported.primitive_id[2] = 3, reported.t[2] = 2.0;        // wrong: behind
  reported.primitive_id[3] = 1;                             // a tie
  reported.primitive_id[4] = 2, reported.t[4] += 1e-9;      // the neighbour, at the same place
  reported.primitive_id[5] = 2, reported.t[5] += 1e-5;      // the neighbour, elsewhere: wrong
  reported.t[6] += 0x1p-20, reported.t_error[6] = 0x1p-21;  // right, but the bound does not cover the error
  const Accuracy found = truth({1, 1, 1, 0, 0, 0, 0, 0}).judge(reported);
  EXPECT_EQ(found.missed.count, 1U);
  EXPECT_EQ(found.false_hits.count, 1U);
  EXPECT_EQ(found.wrong.count, 2U);
  EXPECT_EQ(found.ties.count, 1U);
  EXPECT_EQ(found.neighbours.count, 1U);
  EXPECT_EQ(found.errors().count, 4U);
  EXPECT_EQ(found.leaks.count, 1U);
  EXPECT_EQ(found.leaks.of, 3U);
  // Rays 0, 2, 3, 6: what the ray does not hit has no t of its own.
  EXPECT_EQ(found.covered.of, 4U);
  EXPECT_EQ(found.covered.count, 3U);
  // Rays 0, 3, 4, 6: 2^-20 are eight last places of a float in [1, 2); the diagonal is 10.
  EXPECT_EQ(found.t_error_ulp->max, 8.0);
  EXPECT_EQ(found.t_error_ulp->p50, 0.0);
  EXPECT_DOUBLE_EQ(found.t_error_relative->max, 0x1p-20 / 10.0);
  EXPECT_EQ(truth().other_primitive(reported).count, 6U);
}

TEST_F(PlantedErrors, ATThatIsNoNumberIsAnInfiniteError) {
  ReportedHits reported = right_;
  reported.t[0] = std::numeric_limits<double>::quiet_NaN();
  const Accuracy found = truth().judge(reported);
  EXPECT_EQ(found.t_error_ulp->max, kInfinity);
  EXPECT_EQ(found.covered.count, 6U);
}

TEST_F(PlantedErrors, AnyHitKnowsMissedAndFalseAlone) {
  rays_.kind = RaySetKind::kShadow;
  ReportedHits reported;
  reported.hit = {1, 0, 1, 1, 1, 1, 1, 1};
  const Accuracy found = truth().judge(reported);
  EXPECT_EQ(found.missed.count, 1U);
  EXPECT_EQ(found.false_hits.count, 1U);
  EXPECT_FALSE(found.wrong.known());
  EXPECT_FALSE(found.t_error_ulp);
  EXPECT_FALSE(found.covered.known());
}

TEST_F(PlantedErrors, AStoppedSearchSaysSo) {
  std::stop_source stop;
  stop.request_stop();
  const auto found = Truth::find(*scene_.operator->(), rays_, {}, 10.0, stop.get_token(), {});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::measure
