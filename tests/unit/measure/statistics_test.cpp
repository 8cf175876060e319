#include "core/measure/statistics.h"

#include <gtest/gtest.h>

namespace gridcast::measure {
namespace {

TEST(Statistics, TheMedianIsTheMiddleOne) {
  EXPECT_EQ(median({}), 0.0);
  EXPECT_EQ(median({3.0, 1.0, 2.0}), 2.0);
  EXPECT_EQ(median({4.0, 1.0, 2.0, 3.0}), 2.5);
}

TEST(Statistics, TheSpreadIsTheDistanceOfTheQuartilesByTheMedian) {
  EXPECT_EQ(spread({1.0}), 0.0);
  EXPECT_EQ(spread({1.0, 2.0, 3.0, 4.0, 5.0}), 2.0 / 3.0);
  EXPECT_EQ(spread({2.0, 2.0, 2.0}), 0.0);
}

TEST(Statistics, TheSpeedupComparesRepetitionByRepetition) {
  // The machine halves its speed for the last two: the ratio stays.
  EXPECT_EQ(speedup({1.0, 1.0, 2.0, 2.0}, {3.0, 3.0, 6.0, 6.0}), 3.0);
  EXPECT_EQ(speedup({}, {1.0}), 0.0);
}

}  // namespace
}  // namespace gridcast::measure
