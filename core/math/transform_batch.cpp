// Compiled once per instruction set and chosen at run time by Highway.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/math/transform_batch.cpp"  // NOLINT: Highway includes this file once per target

#include "core/math/transform_batch.h"

#include <bit>
#include <cstddef>
#include <cstring>
#include <type_traits>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#ifndef GRIDCAST_TRANSFORM_LANES
#define GRIDCAST_TRANSFORM_LANES
namespace gridcast {
namespace {
/// All that InstanceTransform holds, of eight.
struct TransformLanes {
  const TransformBatch::MatrixLanes &linear, &inverse;
  const TransformBatch::VectorLanes& translation;
  const TransformBatch::Lanes &condition, &round_trip_error, &active;
};
}  // namespace
}  // namespace gridcast
#endif

HWY_BEFORE_NAMESPACE();
namespace gridcast::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, TransformBatch::kSize>;
using V = hn::Vec<D>;
using Lanes = TransformBatch::Lanes;
using MatrixLanes = TransformBatch::MatrixLanes;
using VectorLanes = TransformBatch::VectorLanes;

/// A matrix of each lane, [column][row].
struct Matrix {
  V m[3][3];
};

HWY_INLINE Matrix load(const MatrixLanes& from, std::size_t lane) {
  Matrix a;
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t r = 0; r < 3; ++r) a.m[c][r] = hn::Load(D(), from[c][r].data() + lane);
  return a;
}

HWY_INLINE V largest_of(V a, V b, V c) {
  return hn::Max(hn::Max(a, b), c);
}

HWY_INLINE V largest_entry(const Matrix& a) {
  V largest = hn::Zero(D());
  for (const auto& column : a.m)
    for (const V entry : column) largest = hn::Max(largest, hn::Abs(entry));
  return largest;
}

/// Two to the power -ilogb(x) for x in [kMinScale, kMaxScale].
HWY_INLINE V power_of_two_below_inverse(V x) {
  const hn::RebindToUnsigned<D> u;
  const auto exponent = hn::And(hn::BitCast(u, x), hn::Set(u, std::uint64_t(0x7FF) << 52));
  return hn::BitCast(D(), hn::Set(u, std::uint64_t(2 * 1023) << 52) - exponent);
}

/// glm::inverse.
HWY_INLINE Matrix inverted(const Matrix& a) {
  const auto& m = a.m;
  // Minors, by the column and the row that are left out.
  const auto minor = [&](int c, int r) HWY_ATTR {
    const int c0 = c == 0 ? 1 : 0, c1 = c == 2 ? 1 : 2, r0 = r == 0 ? 1 : 0, r1 = r == 2 ? 1 : 2;
    return m[c0][r0] * m[c1][r1] - m[c1][r0] * m[c0][r1];
  };
  const V m00 = minor(0, 0), m10 = minor(1, 0), m20 = minor(2, 0);
  const V one = hn::Set(D(), 1.0);
  const V over_determinant = one / (m[0][0] * m00 - m[1][0] * m10 + m[2][0] * m20);
  const V negative = hn::Neg(over_determinant);
  Matrix inverse;
  inverse.m[0][0] = m00 * over_determinant;
  inverse.m[1][0] = minor(0, 1) * negative;
  inverse.m[2][0] = minor(0, 2) * over_determinant;
  inverse.m[0][1] = m10 * negative;
  inverse.m[1][1] = minor(1, 1) * over_determinant;
  inverse.m[2][1] = minor(1, 2) * negative;
  inverse.m[0][2] = m20 * over_determinant;
  inverse.m[1][2] = minor(2, 1) * negative;
  inverse.m[2][2] = minor(2, 2) * over_determinant;
  return inverse;
}

/// Largest row sum of |a * b - 1|.
HWY_INLINE V residual(const Matrix& a, const Matrix& b) {
  const V one = hn::Set(D(), 1.0);
  V sums[3];
  for (std::size_t r = 0; r < 3; ++r) {
    V row[3];
    for (std::size_t c = 0; c < 3; ++c) {
      const V entry = a.m[0][r] * b.m[c][0] + a.m[1][r] * b.m[c][1] + a.m[2][r] * b.m[c][2];
      row[c] = hn::Abs(c == r ? entry - one : entry);
    }
    sums[r] = row[0] + row[1] + row[2];
  }
  return largest_of(sums[0], sums[1], sums[2]);
}

HWY_INLINE auto all_at_most(V a, V b, V c, double limit) {
  const V most = hn::Set(D(), limit);
  return hn::And(hn::And(hn::Le(a, most), hn::Le(b, most)), hn::Le(c, most));
}

/// Returns a bit for each active lane. Comparisons fail for NaN, so what is not finite is not active: any
/// such entry of the inverse makes the row sums and the condition so.
HWY_INLINE std::uint32_t invert_lanes(const MatrixLanes& linear, const VectorLanes& translation,
                                      MatrixLanes& inverses, Lanes& conditions, Lanes& errors,
                                      std::size_t lane) {
  const D d;
  const Matrix a = load(linear, lane);
  auto active = hn::Ge(largest_entry(a), hn::Set(d, kMinScale));
  for (const auto& column : a.m)
    active =
        hn::And(active, all_at_most(hn::Abs(column[0]), hn::Abs(column[1]), hn::Abs(column[2]), kMaxScale));
  const auto moved = [&](std::size_t axis)
                         HWY_ATTR { return hn::Abs(hn::Load(d, translation[axis].data() + lane)); };
  active = hn::And(active, all_at_most(moved(0), moved(1), moved(2), kMaxTranslation));

  const V scale = power_of_two_below_inverse(largest_entry(a));
  Matrix scaled = a;
  for (auto& column : scaled.m)
    for (V& entry : column) entry = entry * scale;
  Matrix inverse = inverted(scaled);
  V rows[3];
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t r = 0; r < 3; ++r) {
      inverse.m[c][r] = inverse.m[c][r] * scale;
      hn::Store(inverse.m[c][r], d, inverses[c][r].data() + lane);
      const V magnitude = hn::Abs(inverse.m[c][r]);
      rows[r] = c == 0 ? magnitude : rows[r] + magnitude;
    }
  V growths[3];
  for (std::size_t r = 0; r < 3; ++r)
    growths[r] = hn::Abs(a.m[0][r]) * rows[0] + hn::Abs(a.m[1][r]) * rows[1] + hn::Abs(a.m[2][r]) * rows[2];
  active = hn::And(active, all_at_most(growths[0], growths[1], growths[2], kMaxCondition));
  const V condition = largest_of(growths[0], growths[1], growths[2]);
  const V error = residual(a, inverse) + hn::Set(d, 12.0 * 0x1p-53) * condition + hn::Set(d, 0x1p-52);
  active = hn::And(active, hn::Le(error, hn::Set(d, kMaxRoundTripError)));
  hn::Store(condition, d, conditions.data() + lane);
  hn::Store(error, d, errors.data() + lane);
  std::uint8_t bits[8] = {0};
  hn::StoreMaskBits(d, active, bits);
  return bits[0];
}

std::uint32_t invert(const MatrixLanes& linear, const VectorLanes& translation, MatrixLanes& inverses,
                     Lanes& conditions, Lanes& errors) {
  std::uint32_t active = 0;
  for (std::size_t lane = 0; lane < TransformBatch::kSize; lane += hn::Lanes(D()))
    active |= invert_lanes(linear, translation, inverses, conditions, errors, lane) << lane;
  return active;
}

/// Numbers 4 k to 4 k + 3 of each of the eight, beside each other.
using Quarters = double[TransformBatch::kSize][4];

HWY_INLINE void interleave(const Lanes& a, const Lanes& b, const Lanes& c, const Lanes& e, Quarters& rows) {
  const D d;
  for (std::size_t lane = 0; lane < TransformBatch::kSize; lane += hn::Lanes(d))
    hn::StoreInterleaved4(hn::Load(d, a.data() + lane), hn::Load(d, b.data() + lane),
                          hn::Load(d, c.data() + lane), hn::Load(d, e.data() + lane), d, rows[lane]);
}

/// Writes the lanes to eight places one after the other, as InstanceTransform lies in memory.
void scatter(const TransformLanes& from, std::byte* const* to, std::size_t count) {
  alignas(64) Quarters quarters[6];
  const MatrixLanes &a = from.linear, &b = from.inverse;
  const VectorLanes& t = from.translation;
  interleave(a[0][0], a[0][1], a[0][2], a[1][0], quarters[0]);
  interleave(a[1][1], a[1][2], a[2][0], a[2][1], quarters[1]);
  interleave(a[2][2], t[0], t[1], t[2], quarters[2]);
  interleave(b[0][0], b[0][1], b[0][2], b[1][0], quarters[3]);
  interleave(b[1][1], b[1][2], b[2][0], b[2][1], quarters[4]);
  interleave(b[2][2], from.condition, from.round_trip_error, from.active, quarters[5]);
  for (std::size_t lane = 0; lane < count; ++lane)
    for (std::size_t k = 0; k < 6; ++k)
      std::memcpy(to[lane] + k * sizeof quarters[k][lane], quarters[k][lane], sizeof quarters[k][lane]);
}

}  // namespace gridcast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast {

HWY_EXPORT(invert);
HWY_EXPORT(scatter);

TransformBatch::TransformBatch() {
  for (std::size_t lane = 0; lane < kSize; ++lane) set(lane, {});
}

void TransformBatch::set(std::size_t lane, const Affine& world_from_object) {
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r)
      linear_[std::size_t(c)][std::size_t(r)][lane] = world_from_object.linear[c][r];
  for (int axis = 0; axis < 3; ++axis)
    translation_[std::size_t(axis)][lane] = world_from_object.translation[axis];
}

void TransformBatch::invert() {
  active_ = HWY_DYNAMIC_DISPATCH(invert)(linear_, translation_, inverse_, condition_, round_trip_error_);
}

void TransformBatch::get(std::size_t lane, InstanceTransform& transform) const {
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) {
      transform.world_from_object_.linear[c][r] = linear_[std::size_t(c)][std::size_t(r)][lane];
      transform.object_from_world_linear_[c][r] = inverse_[std::size_t(c)][std::size_t(r)][lane];
    }
    transform.world_from_object_.translation[c] = translation_[std::size_t(c)][lane];
  }
  transform.condition_ = condition_[lane];
  transform.round_trip_error_ = round_trip_error_[lane];
  transform.active_ = ((active_ >> lane) & 1U) != 0;
}

static_assert(sizeof(InstanceTransform) == 24 * sizeof(double) &&
              std::is_trivially_copyable_v<InstanceTransform>);

void TransformBatch::get(std::span<InstanceTransform* const> transforms) const {
  // A transform is written as the 24 doubles that it takes in memory: the last is `active_` and its padding.
  static_assert(offsetof(InstanceTransform, object_from_world_linear_) == 12 * sizeof(double));
  static_assert(offsetof(InstanceTransform, condition_) == 21 * sizeof(double));
  static_assert(offsetof(InstanceTransform, round_trip_error_) == 22 * sizeof(double));
  static_assert(offsetof(InstanceTransform, active_) == 23 * sizeof(double));
  alignas(64) Lanes active;
  std::byte* places[kSize];
  for (std::size_t lane = 0; lane < kSize; ++lane)
    active[lane] = std::bit_cast<double>(std::uint64_t((active_ >> lane) & 1U));
  for (std::size_t lane = 0; lane < transforms.size(); ++lane) {
    void* const place = transforms[lane];
    places[lane] = static_cast<std::byte*>(place);
  }
  HWY_DYNAMIC_DISPATCH(scatter)
  ({linear_, inverse_, translation_, condition_, round_trip_error_, active}, places, transforms.size());
}

}  // namespace gridcast
#endif
