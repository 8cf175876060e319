#include "core/measure/exact/dyadic.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

namespace gridcast::measure::exact {
namespace {

using Integer = Dyadic::Integer;

constexpr int kDoubleDigits = std::numeric_limits<double>::digits;
constexpr int kLowestExponent = std::numeric_limits<double>::min_exponent - kDoubleDigits;  // of denormals
constexpr double kInfinity = std::numeric_limits<double>::infinity();

enum class Rounding { kNearest, kAwayFromZero, kTowardsZero };

int bit_count(const Integer& positive) {
  return int(msb(positive)) + 1;
}

/// numerator / denominator, both positive, rounded once.
double divide(const Dyadic& numerator, const Dyadic& denominator, Rounding rounding) {
  // A quotient of at least 64 bits, whose last one stands for everything below it.
  const int shift = std::max(0, 65 + bit_count(denominator.mantissa()) - bit_count(numerator.mantissa()));
  Integer quotient, rest;
  divide_qr(Integer(numerator.mantissa() << unsigned(shift)), denominator.mantissa(), quotient, rest);
  int exponent = numerator.exponent() - denominator.exponent() - shift;
  quotient = (quotient << 1U) + (rest.is_zero() ? 0 : 1);
  --exponent;
  // What lies below the last bit of a double goes.
  const int last = std::max(exponent + bit_count(quotient) - kDoubleDigits, kLowestExponent);
  const int drop = last - exponent;
  const Integer kept = quotient >> unsigned(drop);
  const Integer dropped = quotient - (kept << unsigned(drop));
  const int beyond_half = dropped.compare(Integer(1) << unsigned(drop - 1));
  std::uint64_t mantissa = kept.convert_to<std::uint64_t>();
  const bool up = rounding == Rounding::kNearest
                      ? beyond_half > 0 || (beyond_half == 0 && (mantissa & 1U) != 0)
                      : rounding == Rounding::kAwayFromZero && !dropped.is_zero();
  if (up) ++mantissa;
  const double value = std::ldexp(double(mantissa), last);
  return rounding == Rounding::kTowardsZero ? std::min(value, std::numeric_limits<double>::max()) : value;
}

double to_double(const Dyadic& numerator, const Dyadic& denominator, Rounding positive, Rounding negative) {
  if (numerator.sign() == 0) return 0.0;
  return numerator.sign() > 0 ? divide(numerator, denominator, positive)
                              : -divide(-numerator, denominator, negative);
}

/// The exponent of the last place of a double.
int last_place(double value) {
  if (std::isinf(value)) value = std::numeric_limits<double>::max();
  int exponent = 0;
  std::frexp(value, &exponent);
  return value == 0.0 ? kLowestExponent : std::max(exponent - kDoubleDigits, kLowestExponent);
}

Integer aligned(const Dyadic& value, int exponent) {
  return value.mantissa() << unsigned(value.exponent() - exponent);
}

}  // namespace

Dyadic::Dyadic(double value) {
  int exponent = 0;
  auto whole = std::int64_t(std::ldexp(std::frexp(value, &exponent), kDoubleDigits));
  if (whole == 0) return;
  // Without trailing zeros products stay short.
  const int zeros = std::countr_zero(std::uint64_t(whole));
  mantissa_ = whole / (std::int64_t(1) << zeros);
  exponent_ = exponent - kDoubleDigits + zeros;
}

Dyadic operator+(const Dyadic& a, const Dyadic& b) {
  if (a.sign() == 0) return b;
  if (b.sign() == 0) return a;
  const int exponent = std::min(a.exponent_, b.exponent_);
  return {aligned(a, exponent) + aligned(b, exponent), exponent};
}

Dyadic operator-(const Dyadic& a, const Dyadic& b) {
  return a + -b;
}

Dyadic operator*(const Dyadic& a, const Dyadic& b) {
  if (a.sign() == 0 || b.sign() == 0) return {};
  return {a.mantissa_ * b.mantissa_, a.exponent_ + b.exponent_};
}

Ratio::Ratio(Dyadic numerator, Dyadic denominator)
    : numerator_(std::move(numerator)), denominator_(std::move(denominator)) {
  if (denominator_.sign() > 0) return;
  numerator_ = -numerator_;
  denominator_ = -denominator_;
}

double Ratio::to_double() const {
  return exact::to_double(numerator_, denominator_, Rounding::kNearest, Rounding::kNearest);
}

double Ratio::to_double_up() const {
  return exact::to_double(numerator_, denominator_, Rounding::kAwayFromZero, Rounding::kTowardsZero);
}

int compare(const Ratio& a, const Ratio& b) {
  return (a.numerator() * b.denominator() - b.numerator() * a.denominator()).sign();
}

int compare(const Ratio& a, double b) {
  if (std::isinf(b)) return b > 0.0 ? -1 : 1;
  return (a.numerator() - Dyadic(b) * a.denominator()).sign();
}

double absolute_error(const Ratio& exact, double value) {
  if (!std::isfinite(value)) return kInfinity;
  const Dyadic difference = exact.numerator() - Dyadic(value) * exact.denominator();
  return Ratio(difference.sign() < 0 ? -difference : difference, exact.denominator()).to_double_up();
}

double ulp_error(const Ratio& exact, double value) {
  if (!std::isfinite(value)) return kInfinity;
  const int ulp = last_place(exact.to_double());
  const Dyadic difference = exact.numerator() - Dyadic(value) * exact.denominator();
  return Ratio((difference.sign() < 0 ? -difference : difference).scaled(-ulp), exact.denominator())
      .to_double_up();
}

}  // namespace gridcast::measure::exact
