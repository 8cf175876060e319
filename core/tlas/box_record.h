#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/tlas/box_group.h"

namespace gridcast::tlas {

/// An instance as it is filed: its box in floats and its cells.
struct BoxRecord {
  Bounds3f box;
  std::uint32_t instance_id;
  CellRange range;

  /// Bit k: whether the neighbour of `cell` that BoxGroup::seen[k] means lists the instance.
  [[nodiscard]] std::uint32_t seen_from(const Cell& cell) const {
    std::uint32_t bits = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      bits |= std::uint32_t(range.lower[axis] < cell[axis]) << (2 * axis);
      bits |= std::uint32_t(cell[axis] < range.upper[axis]) << (2 * axis + 1);
    }
    return bits;
  }
};

/// Bit k of byte s of `rows` becomes bit s of byte k: "Hacker's Delight", H. Warren, 2003, section 7-3.
[[nodiscard]] inline std::uint64_t transpose_bits(std::uint64_t rows) {
  const auto swap = [&](std::uint32_t distance, std::uint64_t lower) {
    const std::uint64_t differ = (rows ^ (rows >> distance)) & lower;
    rows ^= differ ^ (differ << distance);
  };
  swap(7, 0x00AA00AA00AA00AA);
  swap(14, 0x0000CCCC0000CCCC);
  swap(28, 0x00000000F0F0F0F0);
  return rows;
}

/// Writes all of a group: these instances, which are in `cell`.
template <std::size_t kSlots>
void set_instances(BoxGroup<kSlots>& group, std::span<const BoxRecord* const> records, const Cell& cell) {
  std::uint64_t seen = 0;
  for (std::size_t slot = 0; slot < records.size(); ++slot) {
    group.set_box(slot, records[slot]->box);
    group.links[slot] = records[slot]->instance_id;
    seen |= std::uint64_t(records[slot]->seen_from(cell)) << (8 * slot);
  }
  for (std::size_t slot = records.size(); slot < kSlots; ++slot) group.links[slot] = 0;
  group.clear_boxes(records.size());
  seen = transpose_bits(seen);
  for (std::size_t side = 0; side < 7; ++side) group.seen[side] = std::uint8_t(seen >> (8 * side));
  group.next = NextGroup::kNone;
}

}  // namespace gridcast::tlas
