#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace gridcast {

/// A number m * 2^(64 k) with integers m and k, so that sums and products of doubles are neither rounded nor
/// out of range. The last resort of exact predicates: every operation loops over 64-bit limbs, tens of
/// nanoseconds for numbers of a few of them.
///
/// A number whose limbs would not fit kMaxLimbs is undefined.
class Dyadic {
 public:
  static constexpr int kMaxLimbs = 160;

  Dyadic() = default;
  /// A finite double, exactly.
  explicit Dyadic(double value);
  Dyadic(const Dyadic& other) { *this = other; }
  Dyadic& operator=(const Dyadic& other);
  ~Dyadic() = default;

  /// -1, 0 or 1.
  [[nodiscard]] int sign() const { return size_ == 0 ? 0 : negative_ ? -1 : 1; }

  [[nodiscard]] friend Dyadic operator-(const Dyadic& a) {
    Dyadic negated(a);
    negated.negative_ = !a.negative_;
    return negated;
  }
  friend Dyadic operator+(const Dyadic& a, const Dyadic& b);
  [[nodiscard]] friend Dyadic operator-(const Dyadic& a, const Dyadic& b) { return a + -b; }
  friend Dyadic operator*(const Dyadic& a, const Dyadic& b);

  /// a / b within kQuotientError of itself (and a denormal's rounding, or infinite beyond the largest
  /// double). b is not 0.
  friend double quotient(const Dyadic& a, const Dyadic& b);
  static constexpr double kQuotientError = 0x1.08p-53;

 private:
  /// Limb at 2^(64 place), 0 outside of the number.
  [[nodiscard]] std::uint64_t limb(int place) const {
    return place < lowest_ || place >= lowest_ + size_ ? 0 : limbs_[std::size_t(place - lowest_)];
  }
  [[nodiscard]] int top() const { return lowest_ + size_; }
  [[nodiscard]] bool smaller_than(const Dyadic& other) const;  ///< in size
  void add_sizes(const Dyadic& a, const Dyadic& b);
  void subtract_sizes(const Dyadic& larger, const Dyadic& smaller);
  void trim();
  /// The leading 64 bits, the highest of them set, as an integer to be scaled by 2^exponent; cut, not
  /// rounded.
  [[nodiscard]] std::uint64_t leading_bits(int& exponent) const;

  std::array<std::uint64_t, kMaxLimbs> limbs_;  // size in ascending order; only the first size_ are ever read
  int size_ = 0;
  int lowest_ = 0;  ///< k
  bool negative_ = false;
};

/// a*b - c*d.
[[nodiscard]] inline Dyadic difference_of_products(const Dyadic& a, const Dyadic& b, const Dyadic& c,
                                                   const Dyadic& d) {
  return a * b - c * d;
}

}  // namespace gridcast
