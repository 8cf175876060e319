#pragma once

#include <cstddef>
#include <cstdint>

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

/// Levels of a cell's tree over any number of references that fits an id.
inline constexpr std::size_t kMaxTreeDepth = 16;

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

}  // namespace gridcast::tlas
