#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "core/measure/exact/dyadic.h"
#include "tests/support/random.h"
#include "tests/support/rational_oracle.h"

namespace gridcast::measure::exact {
namespace {

constexpr double kMin = std::numeric_limits<double>::denorm_min();
constexpr double kMax = std::numeric_limits<double>::max();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double round_trip(double value) {
  return Ratio(value, 1.0).to_double();
}

/// A double of any exponent and sign, denormals included, never 0.
double any_double(test::Random& random) {
  const double sign = random.below(2) == 0 ? -1.0 : 1.0;
  return sign * std::ldexp(random.uniform(0.5, 1.0), int(random.below(2096)) - 1072);
}

TEST(ExactNumbers, HoldEveryDouble) {
  for (const double value :
       {0.0, 1.0, -1.0, 0.1, kMin, -kMin, 3 * kMin, 0x1p-1022, 0x1.fffffffffffffp-1023, kMax, -kMax, 1e30})
    EXPECT_EQ(round_trip(value), value);
  test::Random random(test::seed_or(4001));
  for (int i = 0; i < 20'000; ++i) {
    const double value = any_double(random);
    ASSERT_EQ(round_trip(value), value) << std::hexfloat << value;
  }
}

TEST(ExactNumbers, LoseNothingInSumsAndProducts) {
  const Dyadic sum = Dyadic(1e300) + Dyadic(1e-300) - Dyadic(1e300);
  EXPECT_EQ(Ratio(sum, 1.0).to_double(), 1e-300);
  EXPECT_EQ((Dyadic(kMin) * Dyadic(kMin)).exponent(), -2148);
  EXPECT_EQ((Dyadic(0.1) - Dyadic(0.1)).sign(), 0);
  // (2^53 + 1)(2^53 - 1) = 2^106 - 1.
  EXPECT_EQ(((Dyadic(0x1p53) + 1.0) * (Dyadic(0x1p53) - 1.0)).mantissa(), (Dyadic::Integer(1) << 106U) - 1);
}

TEST(ExactNumbers, QuotientsRoundToTheNearestDouble) {
  EXPECT_EQ(Ratio(1.0, 3.0).to_double(), 1.0 / 3.0);
  EXPECT_EQ(Ratio(1.0, -3.0).to_double(), -1.0 / 3.0);
  // Exactly between two doubles: to the even one.
  EXPECT_EQ(Ratio(Dyadic(0x1p53) + 1.0, 1.0).to_double(), 0x1p53);
  EXPECT_EQ(Ratio(Dyadic(0x1p53) + 3.0, 1.0).to_double(), 0x1p53 + 4.0);
  EXPECT_EQ(Ratio(kMin, 2.0).to_double(), 0.0);
  EXPECT_EQ(Ratio(3 * kMin, 2.0).to_double(), 2 * kMin);
  EXPECT_EQ(Ratio(kMin, 1e300).to_double(), 0.0);
  EXPECT_EQ(Ratio(kMax, kMin).to_double(), kInfinity);
  EXPECT_EQ(Ratio(-kMax, kMin).to_double(), -kInfinity);
  test::Random random(test::seed_or(4002));
  for (int i = 0; i < 20'000; ++i) {
    // IEEE division is correctly rounded too.
    const double a = any_double(random), b = any_double(random);
    ASSERT_EQ(Ratio(a, b).to_double(), a / b) << std::hexfloat << a << " / " << b;
  }
}

TEST(ExactNumbers, RoundUpMeansUp) {
  EXPECT_EQ(Ratio(1.0, 4.0).to_double_up(), 0.25);
  EXPECT_EQ(Ratio(kMin, 1e300).to_double_up(), kMin);
  EXPECT_EQ(Ratio(-kMin, 1e300).to_double_up(), 0.0);
  test::Random random(test::seed_or(4003));
  for (int i = 0; i < 5'000; ++i) {
    const Ratio ratio(any_double(random), any_double(random));
    const double up = ratio.to_double_up();
    ASSERT_LE(compare(ratio, up), 0);
    if (std::isfinite(up)) {
      ASSERT_GT(compare(ratio, std::nextafter(up, -kInfinity)), 0);
    }
  }
}

TEST(ExactNumbers, CompareAsRationalsDo) {
  EXPECT_EQ(compare(Ratio(1.0, 3.0), 1.0 / 3.0), 1);
  EXPECT_EQ(compare(Ratio(2.0, 6.0), Ratio(1.0, 3.0)), 0);
  EXPECT_EQ(compare(Ratio(1.0, 3.0), kInfinity), -1);
  EXPECT_EQ(compare(Ratio(1.0, 3.0), -kInfinity), 1);
  test::Random random(test::seed_or(4004));
  for (int i = 0; i < 2'000; ++i) {
    const Ratio a(any_double(random), any_double(random)), b(any_double(random), any_double(random));
    const int expected = cmp(test::to_rational(a), test::to_rational(b));
    ASSERT_EQ(compare(a, b), int(expected > 0) - int(expected < 0));
  }
}

TEST(ExactNumbers, ErrorsAreRoundedUp) {
  EXPECT_EQ(absolute_error(Ratio(1.0, 4.0), 0.25), 0.0);
  EXPECT_EQ(ulp_error(Ratio(1.0, 4.0), 0.25), 0.0);
  EXPECT_EQ(ulp_error(Ratio(1.0, 1.0), 1.0 + 0x1p-52), 1.0);
  EXPECT_EQ(ulp_error(Ratio(1.0, 1.0), 1.0 - 0x1p-53), 0.5);
  EXPECT_EQ(ulp_error(Ratio(kMin, 1.0), 5 * kMin), 4.0);
  EXPECT_EQ(ulp_error(Ratio(0.0, 1.0), kMin), 1.0);
  EXPECT_EQ(absolute_error(Ratio(1.0, 1.0), kInfinity), kInfinity);
  const double third = ulp_error(Ratio(1.0, 3.0), 1.0 / 3.0);
  EXPECT_GT(third, 1.0 / 3.0 - 1e-9);
  EXPECT_LT(third, 1.0 / 3.0 + 1e-9);
  EXPECT_EQ(absolute_error(Ratio(-1.0, 4.0), 0.25), 0.5);
}

}  // namespace
}  // namespace gridcast::measure::exact
