#pragma once
// Exact arithmetic on doubles: sums of error-free products.
// "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", J. R. Shewchuk, 1997.
// Valid while no product leaves [2^-900, 2^1000]; the callers' input limits see to that.

#include <array>
#include <cmath>
#include <cstddef>

#include "core/math/vec.h"

namespace gridcast {

/// The unevaluated sum high + low of two doubles that do not overlap.
struct TwoTerm {
  double high, low;
};

/// a + b exactly (D. E. Knuth's two-sum).
inline TwoTerm two_sum(double a, double b) {
  const double sum = a + b;
  const double b_part = sum - a;
  return {sum, (a - (sum - b_part)) + (b - b_part)};
}
inline TwoTerm two_difference(double a, double b) {
  return two_sum(a, -b);
}
/// a * b exactly.
inline TwoTerm two_product(double a, double b) {
  const double product = a * b;
  return {product, std::fma(a, b, -product)};
}

/// a*b - c*d within 1.5 ulp, so its sign is exact and it is 0 only when the true value is.
/// "Further analysis of Kahan's algorithm for the accurate computation of 2x2 determinants",
/// C.-P. Jeannerod, 2013.
inline double difference_of_products(double a, double b, double c, double d) {
  const double cd = c * d;
  const double error = std::fma(-c, d, cd);
  return std::fma(a, b, -cd) + error;
}

/// A growing exact sum, kept as doubles that do not overlap, smallest first.
template <std::size_t kCapacity>
class Expansion {
 public:
  void add(double term) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const TwoTerm s = two_sum(term, terms_[i]);
      term = s.high;
      if (s.low != 0.0) terms_[kept++] = s.low;
    }
    if (term != 0.0) terms_[kept++] = term;
    size_ = kept;
  }
  /// The sum rounded to double within 1 ulp; its sign is exact, and it is 0 only when the sum is.
  [[nodiscard]] double value() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < size_; ++i) sum += terms_[i];
    return sum;
  }

 private:
  std::array<double, kCapacity> terms_;  // only the first size_ are ever read
  std::size_t size_ = 0;
};

/// d . ((p - o) x (q - o)) within 1 ulp, sign exact: on which side of the line through p and q the ray o + t
/// d passes.
[[nodiscard]] double exact_side(const Vec3d& d, const Vec3d& o, const Vec3d& p, const Vec3d& q);

/// (a - o) . ((b - o) x (c - o)) within 1 ulp, sign exact: on which side of the plane through a, b and c the
/// point o lies. Positive when it is behind the side from which a, b, c run counter-clockwise.
[[nodiscard]] double exact_orientation(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& o);

}  // namespace gridcast
