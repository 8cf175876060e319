// Compiled once per instruction set and chosen at run time by Highway. The same operations in the same order
// as in GridLayout, none of them fused.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/tlas/box_filing.cpp"  // NOLINT: Highway includes this file once per target

#include "core/tlas/box_filing.h"

#include <algorithm>
#include <cstring>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace gridcast::tlas::HWY_NAMESPACE {

static_assert(sizeof(InstanceBox) == 56 && sizeof(Bounds3f) == 24 && sizeof(CellRange) == 12);

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, 8>;
using V = hn::Vec<D>;
/// Vectors that hold the six planes of a box.
constexpr std::size_t kVectors = (6 + hn::MaxLanes(D()) - 1) / hn::MaxLanes(D());

/// A box with its room, and what is needed to file it.
class FiledBox {
 public:
  /// `box` is not empty.
  HWY_INLINE FiledBox(const BoxFiling::Planes& planes, const InstanceBox& box) : planes_(planes) {
    const D d;
    const V pad = hn::Set(d, double(box.drift) * planes.reach + planes.slack);
    bool inside = true;
    for (std::size_t k = 0, plane = 0; k < kVectors; ++k, plane += hn::Lanes(d)) {
      const V outward = hn::Load(d, planes.outward + plane);
      room_[k] = load(box, plane) + outward * pad;
      inside &= hn::AllTrue(d, hn::Le(outward * room_[k], hn::Load(d, planes.border + plane)));
    }
    inside_ = inside;
  }

  [[nodiscard]] HWY_INLINE bool inside() const { return inside_; }

  [[nodiscard]] HWY_INLINE CellRange range() const {
    const D d;
    const hn::Rebind<std::int32_t, D> i;
    const hn::Rebind<std::uint16_t, D> u;
    alignas(16) std::uint16_t cells[8];
    for (std::size_t k = 0, plane = 0; k < kVectors; ++k, plane += hn::Lanes(d)) {
      V index = (room_[k] - hn::Load(d, planes_.origin + plane)) * hn::Load(d, planes_.inverse_cell + plane);
      index = hn::Min(hn::Max(index, hn::Zero(d)), hn::Load(d, planes_.last_cell + plane));
      hn::StoreU(hn::DemoteTo(u, hn::DemoteTo(i, index)), u, cells + plane);
    }
    CellRange range;
    std::memcpy(&range, cells, sizeof range);
    return range;
  }

  HWY_INLINE void write_local_box(Bounds3f& box) const {
    const D d;
    const hn::Rebind<float, D> f;
    alignas(32) float local[8];
    for (std::size_t k = 0, plane = 0; k < kVectors; ++k, plane += hn::Lanes(d)) {
      const V from_center = room_[k] - hn::Load(d, planes_.center + plane);
      hn::StoreU(hn::DemoteTo(f, from_center + hn::Load(d, planes_.rounding + plane)), f, local + plane);
    }
    std::memcpy(&box, local, sizeof box);
  }

 private:
  /// From a plane on; zeros behind the last. A masked load has to be aligned where vectors are short.
  static HWY_INLINE V load(const InstanceBox& box, std::size_t plane) {
    const D d;
    const void* const planes = &box.bounds;
    const double* const at = static_cast<const double*>(planes) + plane;
    return plane + hn::Lanes(d) <= 6 ? hn::LoadU(d, at) : hn::MaskedLoad(hn::FirstN(d, 6 - plane), d, at);
  }

  const BoxFiling::Planes& planes_;
  V room_[kVectors];
  bool inside_;
};

void make_records(const BoxFiling::Planes& planes, const BoxTable& boxes, std::span<const std::uint32_t> ids,
                  BoxRecord* records) {
  // Neighbours in a block are seldom neighbours in the table, so boxes are asked for early.
  constexpr std::size_t kAhead = 12;
  for (std::size_t k = 0; k < ids.size(); ++k) {
    const InstanceBox& ahead = boxes[ids[std::min(k + kAhead, ids.size() - 1)]];
    __builtin_prefetch(&ahead);
    __builtin_prefetch(&ahead.drift);
    const InstanceBox& box = boxes[ids[k]];
    CellRange range;
    Bounds3f local;
    if (!box.bounds.empty()) {
      const FiledBox filed(planes, box);
      if (filed.inside()) range = filed.range();
      filed.write_local_box(local);
    }
    records[k] = {local, ids[k], range};
  }
}

}  // namespace gridcast::tlas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::tlas {

HWY_EXPORT(make_records);

BoxFiling::BoxFiling(const GridLayout& layout) {
  planes_ = {};
  std::fill(std::begin(planes_.border), std::end(planes_.border), 1.0);
  for (std::size_t plane = 0; plane < 6; ++plane) {
    const auto axis = int(plane % 3);
    const double outward = plane < 3 ? -1.0 : 1.0;
    planes_.outward[plane] = outward;
    planes_.border[plane] = outward * (plane < 3 ? layout.bounds.lower[axis] : layout.bounds.upper[axis]);
    planes_.origin[plane] = layout.bounds.lower[axis];
    planes_.inverse_cell[plane] = layout.inverse_cell[axis];
    planes_.last_cell[plane] = double(layout.cells[axis] - 1);
    planes_.center[plane] = layout.center[axis];
    planes_.rounding[plane] = outward * layout.outward;
  }
  planes_.reach = layout.reach;
  planes_.slack = layout.slack;
}

void BoxFiling::make_records(const BoxTable& boxes, std::span<const std::uint32_t> ids,
                             BoxRecord* records) const {
  HWY_DYNAMIC_DISPATCH(make_records)(planes_, boxes, ids, records);
}

}  // namespace gridcast::tlas
#endif
