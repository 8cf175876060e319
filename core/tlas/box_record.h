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

/// What a slot that is not used has: an inverted box, in no cell.
inline constexpr BoxRecord kNoRecord{{}, 0, {{65535, 65535, 65535}, {0, 0, 0}}};

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

}  // namespace gridcast::tlas
