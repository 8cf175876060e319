// Compiled once per instruction set, by which the compiler makes vectors of the loops over planes, and chosen
// at run time by Highway. The same operations in the same order as in GridLayout, none of them fused.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/tlas/box_filing.cpp"  // NOLINT: Highway includes this file once per target

#include "core/tlas/box_filing.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace gridcast::tlas::HWY_NAMESPACE {

constexpr auto kNoRange = std::bit_cast<PackedRange>(CellRange{});
static_assert(sizeof(InstanceBox) == 56 && sizeof(Bounds3f) == 24 && sizeof(CellRange) == 12);

using Numbers = std::array<double, 6>;

/// A box with its room; whether that lies inside the grid.
HWY_INLINE bool grow(const BoxFiling::Planes& planes, const InstanceBox& box, Numbers& room) {
  std::memcpy(room.data(), &box.bounds, sizeof room);
  bool empty = false;
  for (std::size_t axis = 0; axis < 3; ++axis) empty |= !(room[axis] <= room[axis + 3]);
  const double pad = double(box.drift) * planes.reach + planes.slack;
  for (std::size_t plane = 0; plane < 6; ++plane) room[plane] += planes.outward[plane] * pad;
  bool inside = !empty;
  for (std::size_t plane = 0; plane < 6; ++plane)
    inside &= planes.outward[plane] * room[plane] <= planes.border[plane];
  return inside;
}

HWY_INLINE PackedRange range_of(const BoxFiling::Planes& planes, const Numbers& room) {
  PackedRange cells;
  for (std::size_t plane = 0; plane < 6; ++plane) {
    double index = (room[plane] - planes.origin[plane]) * planes.inverse_cell[plane];
    index = index > 0.0 ? index : 0.0;
    index = index < planes.last_cell[plane] ? index : planes.last_cell[plane];
    cells[plane] = std::uint16_t(std::int32_t(index));
  }
  return cells;
}

void find_ranges(const BoxFiling::Planes& planes, std::span<const InstanceBox> boxes, PackedRange* ranges,
                 Bounds3d& bounds) {
  Bounds3d all = bounds;
  for (std::size_t k = 0; k < boxes.size(); ++k) {
    Numbers room;
    ranges[k] = grow(planes, boxes[k], room) ? range_of(planes, room) : kNoRange;
    if (!boxes[k].bounds.empty()) all.extend(boxes[k].bounds);
  }
  bounds = all;
}

void make_records(const BoxFiling::Planes& planes, const BoxTable& boxes, std::span<const std::uint32_t> ids,
                  BoxRecord* records) {
  // Neighbours in a block are seldom neighbours in the table, so boxes are asked for early.
  constexpr std::size_t kAhead = 12;
  for (std::size_t k = 0; k < ids.size(); ++k) {
    const InstanceBox& ahead = boxes[ids[std::min(k + kAhead, ids.size() - 1)]];
    __builtin_prefetch(&ahead);
    __builtin_prefetch(&ahead.drift);
    BoxRecord& record = records[k];
    Numbers room;
    const bool inside = grow(planes, boxes[ids[k]], room);
    std::array<float, 6> local;
    for (std::size_t plane = 0; plane < 6; ++plane)
      local[plane] = float(room[plane] - planes.center[plane] + planes.rounding[plane]);
    record.box = std::bit_cast<Bounds3f>(local);
    record.instance_id = ids[k];
    record.range = std::bit_cast<CellRange>(inside ? range_of(planes, room) : kNoRange);
  }
}

}  // namespace gridcast::tlas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::tlas {

HWY_EXPORT(find_ranges);
HWY_EXPORT(make_records);

BoxFiling::BoxFiling(const GridLayout& layout) {
  std::memset(&planes_, 0, sizeof planes_);
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

void BoxFiling::find_ranges(std::span<const InstanceBox> boxes, PackedRange* ranges, Bounds3d& bounds) const {
  HWY_DYNAMIC_DISPATCH(find_ranges)(planes_, boxes, ranges, bounds);
}

void BoxFiling::make_records(const BoxTable& boxes, std::span<const std::uint32_t> ids,
                             BoxRecord* records) const {
  HWY_DYNAMIC_DISPATCH(make_records)(planes_, boxes, ids, records);
}

}  // namespace gridcast::tlas
#endif
