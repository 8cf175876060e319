#pragma once
// Numbers without rounding: every float and double is m * 2^e, and so are their sums and products.

#include <boost/multiprecision/cpp_int.hpp>

namespace gridcast::measure::exact {

/// m * 2^exponent. 512 bits without an allocation: what a triangle and a ray of one scale need.
class Dyadic {
 public:
  using Integer = boost::multiprecision::number<boost::multiprecision::cpp_int_backend<512>,
                                                boost::multiprecision::et_off>;

  Dyadic() = default;
  /// Exactly `value`, which is finite; denormals too.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Dyadic(double value);
  Dyadic(Integer mantissa, int exponent) : mantissa_(std::move(mantissa)), exponent_(exponent) {}

  [[nodiscard]] int sign() const { return mantissa_.sign(); }
  [[nodiscard]] const Integer& mantissa() const { return mantissa_; }
  [[nodiscard]] int exponent() const { return exponent_; }
  /// This times 2^power.
  [[nodiscard]] Dyadic scaled(int power) const { return {mantissa_, exponent_ + power}; }

  friend Dyadic operator+(const Dyadic& a, const Dyadic& b);
  friend Dyadic operator-(const Dyadic& a, const Dyadic& b);
  friend Dyadic operator*(const Dyadic& a, const Dyadic& b);
  friend Dyadic operator-(const Dyadic& a) { return {-a.mantissa_, a.exponent_}; }

 private:
  Integer mantissa_ = 0;
  int exponent_ = 0;
};

/// A quotient of two such numbers; the denominator is positive.
class Ratio {
 public:
  Ratio() : denominator_(1.0) {}
  /// `denominator` is not 0.
  Ratio(Dyadic numerator, Dyadic denominator);

  [[nodiscard]] const Dyadic& numerator() const { return numerator_; }
  [[nodiscard]] const Dyadic& denominator() const { return denominator_; }

  /// The nearest double, ties to even; +-infinity beyond the largest.
  [[nodiscard]] double to_double() const;
  /// The smallest double that is not below this.
  [[nodiscard]] double to_double_up() const;

 private:
  Dyadic numerator_, denominator_;
};

/// -1, 0 or 1 as a is below, equal to or above b. Infinities are what they say; NaN is not allowed.
[[nodiscard]] int compare(const Ratio& a, const Ratio& b);
[[nodiscard]] int compare(const Ratio& a, double b);

/// |exact - value|, rounded up; +infinity for a value that is not finite.
[[nodiscard]] double absolute_error(const Ratio& exact, double value);
/// The same in units in the last place of the double nearest to `exact`.
[[nodiscard]] double ulp_error(const Ratio& exact, double value);

}  // namespace gridcast::measure::exact
