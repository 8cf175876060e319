// Compiled once per instruction set and chosen at run time by Highway. hit_box.cpp says why the boxes are
// right; here are the same operations in the same order, none of them fused.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/scene/place_batch.cpp"  // NOLINT: Highway includes this file once per target

#include "core/scene/place_batch.h"

#include <array>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/math/transform_lanes-inl.h"
#include "core/scene/hull_lanes-inl.h"
#include "core/tlas/box_rows.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::scene::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using gridcast::HWY_NAMESPACE::Four;
using gridcast::HWY_NAMESPACE::store_rows;
constexpr std::size_t kSize = PlaceBatch::kSize;
constexpr std::size_t kLanes = TransformLanes::kSize;

HWY_INLINE V largest_of(V a, V b, V c) {
  return hn::Max(hn::Max(a, b), c);
}

HWY_INLINE V round_to_float(V x) {
  const D d;
  const hn::Rebind<float, D> f;
  return hn::PromoteTo(d, hn::DemoteTo(f, x));
}

/// tlas::BoxRows::of each box.
using RowsOfBoxes = std::array<double*, kLanes>;

HWY_INLINE void store_boxes(const V (&lower)[3], const V (&upper)[3], V drift, RowsOfBoxes rows) {
  const D d;
  const hn::Rebind<float, D> f;
  const hn::Rebind<std::uint32_t, D> u32;
  const hn::Rebind<std::uint64_t, D> u64;
  const V last = hn::BitCast(d, hn::PromoteTo(u64, hn::BitCast(u32, hn::DemoteTo(f, drift))));
  store_rows(d, Four<D>{{lower[0], lower[1], lower[2], upper[0]}}, rows);
  // One of these once more: a whole row is one store.
  for (double*& row : rows) row += tlas::BoxRows::kUpper;
  store_rows(d, Four<D>{{upper[0], upper[1], upper[2], last}}, rows);
}

template <class Hulls>
HWY_INLINE void write_boxes(const TransformLanes& lanes, const Hulls& hulls, const RowsOfBoxes& rows) {
  const D d;
  const V size = hulls.magnitude();
  const V growth = hn::Set(d, 0x1p-17) * size + hn::Set(d, 0x1p-98);
  V lower[3], upper[3], lengths[3], reaches[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const V n[3] = {lanes.linear()[0][axis], lanes.linear()[1][axis], lanes.linear()[2][axis]};
    const V length = hn::Abs(n[0]) + hn::Abs(n[1]) + hn::Abs(n[2]);
    const V t = lanes.translation()[axis];
    const V room = length * growth + hn::Set(d, 0x1p-50) * (length * size + hn::Abs(t));
    const Reaches reached = hulls.reach(n);
    lower[axis] = t - (reached.backward + room);
    upper[axis] = t + (reached.forward + room);
    reaches[axis] = hn::Max(hn::Abs(lower[axis] - t), hn::Abs(upper[axis] - t));
    lengths[axis] = length;
  }
  const V stretch = largest_of(lengths[0], lengths[1], lengths[2]) * lanes.inverse_norm();
  const V exact_drift = hn::Set(d, 0x1p-40) * stretch + hn::Set(d, 4.0) * lanes.round_trip_error();
  const V drift = round_to_float(exact_drift * hn::Set(d, 1.0 + 0x1p-22));
  const V outward = drift * largest_of(reaches[0], reaches[1], reaches[2]) * hn::Set(d, 1.0 + 0x1p-40);
  V magnitude = hn::Zero(d);
  for (std::size_t axis = 0; axis < 3; ++axis)
    magnitude = hn::Max(magnitude, hn::Max(hn::Abs(lower[axis]), hn::Abs(upper[axis])));
  const V room = outward + hn::Set(d, 0x1p-52) * (magnitude + outward);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    lower[axis] = lower[axis] - room;
    upper[axis] = upper[axis] + room;
  }
  store_boxes(lower, upper, drift, rows);
}

std::uint32_t place(const PlaceBatch::Lanes& batch) {
  std::uint32_t active = 0;
  for (std::size_t first = 0; first < kSize; first += kLanes) {
    std::array<const double*, kLanes> from;
    std::array<double*, kLanes> to;
    RowsOfBoxes boxes;
    for (std::size_t k = 0; k < kLanes; ++k) {
      from[k] = TransformRows::of(*batch.from[first + k]);
      to[k] = TransformRows::of(*batch.transforms[first + k]);
      boxes[k] = tlas::BoxRows::of(*batch.boxes[first + k]);
    }
    const TransformLanes lanes(from);
    lanes.store(to);
    if (batch.one_hull) {
      write_boxes(lanes, OneHull(*batch.hulls[0]), boxes);
    } else {
      write_boxes(lanes, HullOfEachLane(batch.hulls.data() + first), boxes);
    }
    active |= lanes.active() << first;
  }
  return active;
}

}  // namespace gridcast::scene::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::scene {

HWY_EXPORT(place);

std::uint32_t PlaceBatch::place() {
  for (std::size_t k = count_; k < kSize; ++k) {
    from_[k] = &spare_.from;
    hulls_[k] = hulls_[0];
    transforms_[k] = &spare_.transform;
    boxes_[k] = &spare_.box;
  }
  const std::uint32_t active = HWY_DYNAMIC_DISPATCH(place)({from_, hulls_, transforms_, boxes_, one_hull_});
  if (!one_hull_ || hulls_[0]->empty())
    for (std::size_t k = 0; k < count_; ++k)
      if (hulls_[k]->empty()) *boxes_[k] = {};
  return active & ((1U << count_) - 1U);
}

}  // namespace gridcast::scene
#endif
