#include "core/math/dyadic.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/rational.h"

namespace gridcast {
namespace {

using test::Random;

/// Any finite double, denormals and zeros among them; few bits in half of them, so that sums cancel.
double any_double(Random& random) {
  const int bits = random.below(2) == 0 ? 53 : 6;
  const double mantissa = std::floor(std::ldexp(random.uniform(-1.0, 1.0), bits));
  const int range = random.below(2) == 0 ? 1000 : 70;
  return std::ldexp(mantissa, int(random.below(std::uint32_t(2 * range))) - range - 60);
}

TEST(Dyadic, SumsAndProductsHaveTheSignOfRationals) {
  Random random(test::seed_or(6101));
  for (int i = 0; i < 20000; ++i) {
    const double a = any_double(random), b = any_double(random), c = any_double(random);
    const double d = random.below(3) == 0 ? a * b : any_double(random);
    if (!std::isfinite(d)) continue;
    const mpq_class expected = mpq_class(a) * mpq_class(b) - mpq_class(c) * mpq_class(d) + mpq_class(d);
    const Dyadic found = difference_of_products(Dyadic(a), Dyadic(b), Dyadic(c), Dyadic(d)) + Dyadic(d);
    ASSERT_EQ(found.sign(), sgn(expected)) << std::hexfloat << a << " " << b << " " << c << " " << d;
    const mpq_class none = mpq_class(a) * mpq_class(b) - mpq_class(b) * mpq_class(a);
    ASSERT_EQ(difference_of_products(Dyadic(a), Dyadic(b), Dyadic(b), Dyadic(a)).sign(), sgn(none));
  }
}

TEST(Dyadic, QuotientsAreWithinTheirBound) {
  Random random(test::seed_or(6102));
  for (int i = 0; i < 20000; ++i) {
    const double a = any_double(random), b = any_double(random), c = random.uniform(1.0, 2.0);
    if (a == 0.0 || b == 0.0) continue;
    const mpq_class expected = mpq_class(a) * mpq_class(c) / (mpq_class(b) * mpq_class(c) * mpq_class(c));
    const double found = quotient(Dyadic(a) * Dyadic(c), Dyadic(b) * Dyadic(c) * Dyadic(c));
    if (std::abs(found) < 0x1p-1000 || !std::isfinite(found)) continue;
    ASSERT_LE(abs(mpq_class(found) - expected), abs(expected) * mpq_class(Dyadic::kQuotientError))
        << std::hexfloat << a << " / " << b;
  }
  EXPECT_EQ(quotient(Dyadic(0.0), Dyadic(3.0)), 0.0);
  EXPECT_EQ(quotient(Dyadic(-6.0), Dyadic(3.0)), -2.0);
  EXPECT_EQ(quotient(Dyadic(0x1p-1074), Dyadic(0x1p-1074)), 1.0);
}

}  // namespace
}  // namespace gridcast
