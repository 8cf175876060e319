#include "core/math/certified.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/rational.h"

namespace gridcast {
namespace {

using test::Rational;

struct Both {
  Certified certified;
  Rational exact;
};

Both operator+(const Both& a, const Both& b) {
  return {a.certified + b.certified, a.exact + b.exact};
}
Both operator-(const Both& a, const Both& b) {
  return {a.certified - b.certified, a.exact - b.exact};
}
Both operator*(const Both& a, const Both& b) {
  return {a.certified * b.certified, a.exact * b.exact};
}

Both number(test::Random& random, double range) {
  const double value = random.uniform(-1.0, 1.0) * std::exp2(random.uniform(-range, range));
  return {value, Rational(value)};
}

void expect_covered(const Both& both) {
  const Certified& c = both.certified;
  const Rational off = abs(both.exact - Rational(c.high) - Rational(c.low));
  ASSERT_LE(off, Rational(c.error));
  ASSERT_LE(Rational(c.least_size()), abs(both.exact));
  ASSERT_GE(Rational(c.greatest_size()), abs(both.exact));
  ASSERT_EQ(c.high + c.low, c.high) << "the two terms overlap";
}

TEST(Certified, covers_chains_of_sums_and_products_that_cancel) {
  test::Random random(test::seed_or(91));
  for (int i = 0; i < 3000; ++i) {
    const double range = i % 3 == 0 ? 40.0 : 2.0;
    const Both a = number(random, range), b = number(random, range), c = number(random, range);
    const Both sum = (a * b + c) * (b - c);
    expect_covered(sum);
    // What is left is only the products' rounding, or nothing.
    expect_covered(sum - a * b * b + a * b * c - c * b);
    expect_covered((sum - a * b * b + a * b * c - c * b) + c * c);
    expect_covered(((sum + a) - sum) * ((sum * b) - b * sum) - a);
  }
}

TEST(Certified, covers_sums_alone_and_products_alone) {
  test::Random random(test::seed_or(94));
  for (int i = 0; i < 3000; ++i) {
    const Both a = number(random, 40.0), b = number(random, 40.0), c = number(random, 40.0);
    expect_covered(a * b * c * b * a);
    expect_covered(a + b + c + number(random, 90.0) + number(random, 90.0) - a - b - c);
  }
}

TEST(Certified, covers_numbers_that_underflow) {
  test::Random random(test::seed_or(92));
  for (int i = 0; i < 300; ++i) {
    const Both tiny{0x1p-1000, Rational(0x1p-1000)};
    const Both a = tiny * number(random, 30.0), b = number(random, 60.0);
    expect_covered(a * b * number(random, 300.0));
    expect_covered(a * a - b * a);
  }
}

TEST(Certified, is_good_to_a_hundred_bits) {
  test::Random random(test::seed_or(93));
  for (int i = 0; i < 300; ++i) {
    const Both a = number(random, 2.0), b = number(random, 2.0);
    const Both product = (a * b) * (b * a);
    EXPECT_LE(product.certified.error, 0x1p-98 * product.certified.size());
  }
}

}  // namespace
}  // namespace gridcast
