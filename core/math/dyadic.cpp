#include "core/math/dyadic.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace gridcast {
namespace {

__extension__ using Uint128 = unsigned __int128;

constexpr int kLimbBits = 64;

}  // namespace

Dyadic::Dyadic(double value) : negative_(value < 0.0) {
  if (value == 0.0) return;
  int exponent = 0;
  const double fraction = std::frexp(std::abs(value), &exponent);
  const auto mantissa = std::uint64_t(std::ldexp(fraction, 53));
  exponent -= 53;
  lowest_ = exponent >= 0 ? exponent / kLimbBits : -((kLimbBits - 1 - exponent) / kLimbBits);
  const int shift = exponent - kLimbBits * lowest_;
  limbs_[0] = mantissa << shift;
  limbs_[1] = shift == 0 ? 0 : mantissa >> (kLimbBits - shift);
  size_ = 2;
  trim();
}

Dyadic& Dyadic::operator=(const Dyadic& other) {
  if (this == &other) return *this;
  std::copy_n(other.limbs_.begin(), other.size_, limbs_.begin());
  size_ = other.size_;
  lowest_ = other.lowest_;
  negative_ = other.negative_;
  return *this;
}

/// Without zeros at either end, so that zero has no limbs.
void Dyadic::trim() {
  while (size_ > 0 && limbs_[std::size_t(size_ - 1)] == 0) --size_;
  int zeros = 0;
  while (zeros < size_ && limbs_[std::size_t(zeros)] == 0) ++zeros;
  if (zeros == 0) return;
  std::copy(limbs_.begin() + zeros, limbs_.begin() + size_, limbs_.begin());
  size_ -= zeros;
  lowest_ += zeros;
}

bool Dyadic::smaller_than(const Dyadic& other) const {
  if (top() != other.top()) return top() < other.top();
  for (int place = top() - 1; place >= std::min(lowest_, other.lowest_); --place)
    if (limb(place) != other.limb(place)) return limb(place) < other.limb(place);
  return false;
}

void Dyadic::add_sizes(const Dyadic& a, const Dyadic& b) {
  lowest_ = std::min(a.lowest_, b.lowest_);
  size_ = std::max(a.top(), b.top()) - lowest_;
  std::uint64_t carry = 0;
  for (int i = 0; i < size_; ++i) {
    const Uint128 sum = Uint128(a.limb(lowest_ + i)) + b.limb(lowest_ + i) + carry;
    limbs_[std::size_t(i)] = std::uint64_t(sum);
    carry = std::uint64_t(sum >> kLimbBits);
  }
  if (carry != 0) limbs_[std::size_t(size_++)] = carry;
}

void Dyadic::subtract_sizes(const Dyadic& larger, const Dyadic& smaller) {
  lowest_ = std::min(larger.lowest_, smaller.lowest_);
  size_ = larger.top() - lowest_;
  std::uint64_t borrow = 0;
  for (int i = 0; i < size_; ++i) {
    const Uint128 difference = Uint128(larger.limb(lowest_ + i)) - smaller.limb(lowest_ + i) - borrow;
    limbs_[std::size_t(i)] = std::uint64_t(difference);
    borrow = std::uint64_t(difference >> kLimbBits) & 1U;
  }
}

Dyadic operator+(const Dyadic& a, const Dyadic& b) {
  if (a.size_ == 0) return b;
  if (b.size_ == 0) return a;
  Dyadic sum;
  if (a.negative_ == b.negative_) {
    sum.add_sizes(a, b);
    sum.negative_ = a.negative_;
  } else {
    const bool swapped = a.smaller_than(b);
    sum.subtract_sizes(swapped ? b : a, swapped ? a : b);
    sum.negative_ = swapped ? b.negative_ : a.negative_;
  }
  sum.trim();
  return sum;
}

Dyadic operator*(const Dyadic& a, const Dyadic& b) {
  Dyadic product;
  if (a.size_ == 0 || b.size_ == 0) return product;
  product.lowest_ = a.lowest_ + b.lowest_;
  product.size_ = a.size_ + b.size_;
  product.negative_ = a.negative_ != b.negative_;
  std::fill_n(product.limbs_.begin(), product.size_, 0);
  for (int i = 0; i < a.size_; ++i) {
    const std::uint64_t factor = a.limbs_[std::size_t(i)];
    std::uint64_t carry = 0;
    for (int j = 0; j < b.size_; ++j) {
      std::uint64_t& out = product.limbs_[std::size_t(i) + std::size_t(j)];
      const Uint128 sum = Uint128(factor) * b.limbs_[std::size_t(j)] + out + carry;
      out = std::uint64_t(sum);
      carry = std::uint64_t(sum >> kLimbBits);
    }
    product.limbs_[std::size_t(i) + std::size_t(b.size_)] = carry;
  }
  product.trim();
  return product;
}

std::uint64_t Dyadic::leading_bits(int& exponent) const {
  const std::uint64_t first = limb(top() - 1);
  const int zeros = std::countl_zero(first);
  exponent = kLimbBits * (top() - 1) - zeros;
  return zeros == 0 ? first : first << zeros | limb(top() - 2) >> (kLimbBits - zeros);
}

// Both operands are cut by less than 2^-63 of themselves, the integer quotient, at least 2^61, by less than
// 2^-61, and its rounding to double is below 2^-53: together less than 2^-53 (1 + 2^-5).
double quotient(const Dyadic& a, const Dyadic& b) {
  if (a.size_ == 0) return 0.0;
  int exponent_a = 0, exponent_b = 0;
  const std::uint64_t above = a.leading_bits(exponent_a);
  const std::uint64_t below = b.leading_bits(exponent_b);
  const auto ratio = std::uint64_t((Uint128(above) << 62) / below);
  const double size = std::ldexp(double(ratio), exponent_a - exponent_b - 62);
  return a.negative_ == b.negative_ ? size : -size;
}

}  // namespace gridcast
