#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "core/math/bounds.h"
#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

/// What comes after a group of a cell.
enum class NextGroup : std::uint8_t { kNone, kFour, kEight };

/// Boxes beside each other, so that one load gives a plane of all: floats from the centre of the grid,
/// rounded outward. Two cache lines for four boxes, four for eight. An unused slot has an inverted box, which
/// no ray enters.
template <std::size_t kSlots>
struct alignas(64) BoxGroup {
  float planes[2][3][kSlots];   ///< [lower, upper][axis][slot]
  std::uint32_t links[kSlots];  ///< instance ids; in a node of a cell's tree: see tree_link
  /// Bit s of seen[2 axis]: the cell before along the axis lists the instance of slot s too, so a walk that
  /// comes from there has tested it. seen[2 axis + 1]: likewise for the cell after. seen[6] is 0, for the
  /// first cell of a walk.
  std::uint8_t seen[7];
  NextGroup next;

  /// No slot is used.
  void clear() {
    *this = {};
    clear_boxes(0);
  }
  /// From `first` on.
  void clear_boxes(std::size_t first) {
    for (std::size_t slot = first; slot < kSlots; ++slot) set_box(slot, {});
  }
  void set_box(std::size_t slot, const Bounds3f& box) {
    for (int axis = 0; axis < 3; ++axis) {
      planes[0][axis][slot] = box.lower[axis];
      planes[1][axis][slot] = box.upper[axis];
    }
  }
  [[nodiscard]] Bounds3f box(std::size_t slot) const {
    return {{planes[0][0][slot], planes[0][1][slot], planes[0][2][slot]},
            {planes[1][0][slot], planes[1][1][slot], planes[1][2][slot]}};
  }
};
static_assert(sizeof(BoxGroup<4>) == 128 && sizeof(BoxGroup<8>) == 256);

/// Most boxes of a cell that are tested one group after the other; more get a tree.
inline constexpr std::size_t kMaxFlat = 32;

/// Links of a tree's inner nodes: index of a node or leaf (both groups of eight) in the cell's groups.
namespace tree_link {
inline constexpr std::uint32_t kLeafBit = 1U << 31;
inline bool is_leaf(std::uint32_t link) {
  return (link & kLeafBit) != 0;
}
inline std::uint32_t index(std::uint32_t link) {
  return link & ~kLeafBit;
}
}  // namespace tree_link

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
