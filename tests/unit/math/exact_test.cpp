#include "core/math/exact.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace gridcast {
namespace {

__extension__ using Wide = __int128;

Vec3d integers(test::Random& random, std::int64_t half) {
  auto one = [&] { return double(std::int64_t(random.bits() % std::uint64_t(2 * half + 1)) - half); };
  const double x = one(), y = one(), z = one();
  return {x, y, z};
}

/// d . ((p - o) x (q - o)) in 128-bit integers, with coordinates below 2^40.
Wide reference(const Vec3d& d, const Vec3d& o, const Vec3d& p, const Vec3d& q) {
  auto difference = [](double a, double b) { return Wide(std::int64_t(a) - std::int64_t(b)); };
  Wide a[3], b[3];
  for (int i = 0; i < 3; ++i) {
    a[i] = difference(p[i], o[i]);
    b[i] = difference(q[i], o[i]);
  }
  Wide sum = 0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    sum += Wide(std::int64_t(d[i])) * (a[j] * b[k] - a[k] * b[j]);
  }
  return sum;
}

TEST(ExactSide, equals_integer_arithmetic) {
  test::Random random(test::seed_or(11));
  for (int i = 0; i < 20000; ++i) {
    const std::int64_t half = std::int64_t(1) << (2 + i % 38);
    Vec3d d = integers(random, half);
    const Vec3d o = integers(random, half), p = integers(random, half);
    // Through p exactly, or not quite; along an axis.
    if (i % 5 == 1 && half < (1 << 18)) d = double(1 + i % 3) * (p - o) + Vec3d(0.0, i % 2, 0.0);
    if (i % 5 == 2) d[i % 3] = d[(i + 1) % 3] = 0.0;
    // Every third q lies on the line from p along d, where the true value is 0, or one unit beside it.
    Vec3d q = integers(random, half);
    if (i % 3 != 0 && half < (1 << 18)) q = p + double(i % 7) * d + Vec3d(i % 3 == 2 ? 1.0 : 0.0, 0.0, 0.0);
    const Wide expected = reference(d, o, p, q);
    const double value = exact_side(d, o, p, q);
    ASSERT_EQ(value > 0.0, expected > 0) << i;
    ASSERT_EQ(value < 0.0, expected < 0) << i;
    ASSERT_NEAR(value, double(expected), std::abs(double(expected)) * 0x1p-52) << i;
  }
}

TEST(ExactSide, survives_cancellation_that_defeats_double) {
  // o is far away: p - o and q - o agree in their leading 53 bits.
  const Vec3d o{0x1p60, 0.0, 0.0}, d{1.0, 0.0, 0.0};
  const Vec3d p{0.1, 0x1p-80, 1.0}, q{0.3, 0x1p-80 + 0x1p-120, 1.0};
  EXPECT_LT(exact_side(d, o, p, q), 0.0);
  EXPECT_GT(exact_side(d, o, q, p), 0.0);
  EXPECT_EQ(exact_side(d, o, p, p), 0.0);
}

TEST(DifferenceOfProducts, is_zero_only_when_the_products_are_equal) {
  const double a = 1.0 + 0x1p-52, b = 1.0 - 0x1p-52;
  EXPECT_EQ(difference_of_products(a, b, 1.0, 1.0), -0x1p-104);
  EXPECT_EQ(difference_of_products(3.0, 5.0, 5.0, 3.0), 0.0);
}

}  // namespace
}  // namespace gridcast
