// InstanceTransform of several at once, one in each lane, bit for bit, with every instruction set: the same
// operations in the same order, none of them fused. Included once per instruction set (see
// hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_MATH_TRANSFORM_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_MATH_TRANSFORM_LANES_INL_H
#undef GRIDCAST_MATH_TRANSFORM_LANES_INL_H
#else
#define GRIDCAST_MATH_TRANSFORM_LANES_INL_H
#endif

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <hwy/highway.h>

#include "core/math/lane_rows-inl.h"
#include "core/math/transform_rows.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Eight at most.
using TransformTag = hn::CappedTag<double, 8>;

/// The transforms of the lanes. Matrices are [column][row].
class TransformLanes {
 public:
  static constexpr std::size_t kSize = hn::MaxLanes(TransformTag());
  using D = TransformTag;
  using V = hn::Vec<D>;
  using Matrix = V[3][3];

  /// From the affine maps, whose inverses are made. `rows` are TransformRows::of those.
  HWY_INLINE explicit TransformLanes(const std::array<const double*, kSize>& rows) {
    load(rows);
    invert();
  }

  [[nodiscard]] HWY_INLINE const Matrix& linear() const { return linear_; }
  [[nodiscard]] HWY_INLINE const V (&translation() const)[3] { return translation_; }
  [[nodiscard]] HWY_INLINE V round_trip_error() const { return error_; }
  /// row_sum_norm of the inverses.
  [[nodiscard]] HWY_INLINE V inverse_norm() const { return inverse_norm_; }
  /// Bit k: lane k is active.
  [[nodiscard]] HWY_INLINE std::uint32_t active() const {
    std::uint8_t bits[8] = {0};
    hn::StoreMaskBits(D(), hn::Le(error_, hn::Set(D(), kMaxRoundTripError)), bits);
    return bits[0];
  }
  /// To TransformRows::of each.
  HWY_INLINE void store(const std::array<double*, kSize>& rows) const {
    const D d;
    const Matrix &a = linear_, &b = inverse_;
    const V(&t)[3] = translation_;
    store_rows(d, Four<D>{{a[0][0], a[0][1], a[0][2], a[1][0]}}, rows);
    store_rows(d, Four<D>{{a[1][1], a[1][2], a[2][0], a[2][1]}}, moved(rows, 4));
    store_rows(d, Four<D>{{a[2][2], t[0], t[1], t[2]}}, moved(rows, 8));
    store_rows(d, Four<D>{{b[0][0], b[0][1], b[0][2], b[1][0]}}, moved(rows, 12));
    store_rows(d, Four<D>{{b[1][1], b[1][2], b[2][0], b[2][1]}}, moved(rows, 16));
    // Two of these once more: a whole row is one store.
    store_rows(d, Four<D>{{b[2][0], b[2][1], b[2][2], error_}}, moved(rows, 18));
  }

 private:
  template <class T>
  static HWY_INLINE std::array<T*, kSize> moved(std::array<T*, kSize> rows, std::size_t by) {
    for (T*& row : rows) row += by;
    return rows;
  }

  HWY_INLINE void load(const std::array<const double*, kSize>& rows) {
    const D d;
    const Four<D> first = load_rows(d, rows), second = load_rows(d, moved(rows, 4)),
                  third = load_rows(d, moved(rows, 8));
    for (std::size_t k = 0; k < 4; ++k) {
      linear_[k / 3][k % 3] = first.v[k];
      linear_[(k + 4) / 3][(k + 4) % 3] = second.v[k];
    }
    linear_[2][2] = third.v[0];
    for (std::size_t axis = 0; axis < 3; ++axis) translation_[axis] = third.v[axis + 1];
  }

  static HWY_INLINE V largest_of(V a, V b, V c) { return hn::Max(hn::Max(a, b), c); }

  static HWY_INLINE V largest_entry(const Matrix& a) {
    V largest = hn::Zero(D());
    for (const auto& column : a)
      for (const V entry : column) largest = hn::Max(largest, hn::Abs(entry));
    return largest;
  }

  /// glm::inverse.
  static HWY_INLINE void inverted(const Matrix& m, Matrix& inverse) {
    // Minors, by the column and the row that are left out.
    const auto minor = [&](int c, int r) HWY_ATTR {
      const int c0 = c == 0 ? 1 : 0, c1 = c == 2 ? 1 : 2, r0 = r == 0 ? 1 : 0, r1 = r == 2 ? 1 : 2;
      return m[c0][r0] * m[c1][r1] - m[c1][r0] * m[c0][r1];
    };
    const V m00 = minor(0, 0), m10 = minor(1, 0), m20 = minor(2, 0);
    const V one = hn::Set(D(), 1.0);
    const V over_determinant = one / (m[0][0] * m00 - m[1][0] * m10 + m[2][0] * m20);
    const V negative = hn::Neg(over_determinant);
    inverse[0][0] = m00 * over_determinant;
    inverse[1][0] = minor(0, 1) * negative;
    inverse[2][0] = minor(0, 2) * over_determinant;
    inverse[0][1] = m10 * negative;
    inverse[1][1] = minor(1, 1) * over_determinant;
    inverse[2][1] = minor(1, 2) * negative;
    inverse[0][2] = m20 * over_determinant;
    inverse[1][2] = minor(2, 1) * negative;
    inverse[2][2] = minor(2, 2) * over_determinant;
  }

  /// Largest row sum of |linear * inverse - 1|.
  HWY_INLINE V residual() const {
    const V one = hn::Set(D(), 1.0);
    const Matrix &a = linear_, &b = inverse_;
    V sums[3];
    for (std::size_t r = 0; r < 3; ++r) {
      V row[3];
      for (std::size_t c = 0; c < 3; ++c) {
        const V entry = a[0][r] * b[c][0] + a[1][r] * b[c][1] + a[2][r] * b[c][2];
        row[c] = hn::Abs(c == r ? entry - one : entry);
      }
      sums[r] = row[0] + row[1] + row[2];
    }
    return largest_of(sums[0], sums[1], sums[2]);
  }

  static HWY_INLINE auto all_at_most(V a, V b, V c, double limit) {
    const V most = hn::Set(D(), limit);
    return hn::And(hn::And(hn::Le(a, most), hn::Le(b, most)), hn::Le(c, most));
  }

  /// Comparisons fail for NaN, so what is not finite is not active: any such entry of the matrix, which the
  /// largest one may hide, or of the inverse makes the growths so.
  HWY_INLINE void invert() {
    const D d;
    const Matrix& a = linear_;
    const V largest = largest_entry(a);
    auto active = hn::And(hn::Ge(largest, hn::Set(d, kMinScale)), hn::Le(largest, hn::Set(d, kMaxScale)));
    active = hn::And(active, all_at_most(hn::Abs(translation_[0]), hn::Abs(translation_[1]),
                                         hn::Abs(translation_[2]), kMaxTranslation));

    inverted(a, inverse_);
    V rows[3];
    for (std::size_t r = 0; r < 3; ++r)
      rows[r] = hn::Abs(inverse_[0][r]) + hn::Abs(inverse_[1][r]) + hn::Abs(inverse_[2][r]);
    inverse_norm_ = largest_of(rows[0], rows[1], rows[2]);
    active = hn::And(active, all_at_most(rows[0], rows[1], rows[2], kMaxInverse));
    V growths[3];
    for (std::size_t r = 0; r < 3; ++r)
      growths[r] = hn::Abs(a[0][r]) * rows[0] + hn::Abs(a[1][r]) * rows[1] + hn::Abs(a[2][r]) * rows[2];
    active = hn::And(active, all_at_most(growths[0], growths[1], growths[2], kMaxCondition));
    const V condition = largest_of(growths[0], growths[1], growths[2]);
    const V error = residual() + hn::Set(d, 12.0 * 0x1p-53) * condition + hn::Set(d, 0x1p-52);
    active = hn::And(active, hn::Le(error, hn::Set(d, kMaxRoundTripError)));
    error_ = hn::IfThenElse(active, error, hn::Set(d, std::numeric_limits<double>::infinity()));
  }

  Matrix linear_, inverse_;
  V translation_[3];
  V inverse_norm_, error_;
};

}  // namespace gridcast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
