#pragma once
// Numbers of twice double's precision that carry a bound of their own error.

#include <array>
#include <cmath>

#include "core/math/exact.h"

namespace gridcast {

/// A real number known to lie within `error` of high + low, where |low| <= 2^-53 |high|. "A floating-point
/// technique for extending the available precision", T. J. Dekker, 1971, gives the arithmetic; that every
/// result carries its bound is added here, so that no derivation has to follow a whole formula.
///
/// Errors of one operation, with u = 2^-53: a sum rounds twice, each time a number below 2 u (|a| + |b|):
/// less than 4 u^2 (|a| + |b|) together. A product drops the product of the low parts and rounds four times a
/// number below 4 u |a b|: less than 17 u^2 |a b| together. The constants below are nearly twice that, and
/// `kTiny` far more than underflow can add; the excess covers the rounding of the bounds themselves, a
/// relative 4 u an operation, in any formula of reasonable length.
struct Certified {
  double high = 0.0;
  double low = 0.0;
  double error = 0.0;

  Certified() = default;
  /// Exactly this double.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Certified(double value) : high(value) {}
  /// high + low to the last bit, whichever is larger.
  Certified(double rough_high, double rough_low, double bound) : error(bound) {
    const TwoTerm sum = two_sum(rough_high, rough_low);
    high = sum.high;
    low = sum.low;
  }

  static constexpr double kSum = 0x1p-103;
  static constexpr double kProduct = 0x1p-101;
  static constexpr double kTiny = 0x1p-1000;

  [[nodiscard]] double size() const { return std::abs(high); }
  /// At most the absolute value of the real number; negative where it may be 0.
  [[nodiscard]] double least_size() const { return size() * (1.0 - 0x1p-50) - error; }
  /// At least the absolute value of the real number.
  [[nodiscard]] double greatest_size() const { return size() * (1.0 + 0x1p-50) + error; }

  friend Certified operator-(const Certified& a) { return {-a.high, -a.low, a.error}; }
  friend Certified operator+(const Certified& a, const Certified& b) {
    const TwoTerm sum = two_sum(a.high, b.high);
    return {sum.high, sum.low + (a.low + b.low), (a.error + b.error) + kSum * (a.size() + b.size()) + kTiny};
  }
  friend Certified operator-(const Certified& a, const Certified& b) { return a + -b; }
  friend Certified operator*(const Certified& a, const Certified& b) {
    const TwoTerm product = two_product(a.high, b.high);
    const double carried = a.greatest_size() * b.error + b.size() * a.error;
    return {product.high, product.low + (a.high * b.low + a.low * b.high),
            carried + kProduct * std::abs(product.high) + kTiny};
  }
};

using Certified3 = std::array<Certified, 3>;

[[nodiscard]] inline Certified3 certified(const Vec3d& v) {
  return {v.x, v.y, v.z};
}
[[nodiscard]] inline Certified3 operator+(const Certified3& a, const Certified3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
[[nodiscard]] inline Certified3 operator-(const Certified3& a, const Certified3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
[[nodiscard]] inline Certified3 operator*(const Certified& a, const Certified3& b) {
  return {a * b[0], a * b[1], a * b[2]};
}
[[nodiscard]] inline Certified dot(const Certified3& a, const Certified3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
[[nodiscard]] inline Certified3 cross(const Certified3& a, const Certified3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace gridcast
