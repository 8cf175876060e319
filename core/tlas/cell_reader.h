#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/tlas/grid_block.h"

namespace gridcast::tlas {

/// A cell's groups as a flat list or a tree, looked at slot by slot: calls visit(id, box, seen) for every
/// instance, once each. The bits of `seen` are those of BoxRecord::seen_from.
template <class Visit>
class CellReader {
 public:
  explicit CellReader(const Visit& visit) : visit_(visit) {}

  /// False when the groups are not a sound cell.
  bool read(const GridBlock::CellStart& cell) const {
    if (cell.kind == CellKind::kTree) return read_tree(cell.groups, 0, {Vec3f(-kAll), Vec3f(kAll)}, 0, 0);
    const std::byte* at = cell.groups;
    NextGroup next = cell.kind == CellKind::kFour ? NextGroup::kFour : NextGroup::kEight;
    while (next != NextGroup::kNone) next = next == NextGroup::kFour ? read_group<4>(at) : read_group<8>(at);
    return true;
  }

 private:
  static constexpr float kAll = std::numeric_limits<float>::infinity();

  template <std::size_t kSlots>
  static const BoxGroup<kSlots>& group_at(const std::byte* bytes) {
    const void* at = bytes;
    return *static_cast<const BoxGroup<kSlots>*>(at);
  }
  template <std::size_t kSlots>
  static std::uint32_t seen_of(const BoxGroup<kSlots>& group, std::size_t slot) {
    std::uint32_t bits = 0;
    for (std::uint32_t side = 0; side < 7; ++side) bits |= ((group.seen[side] >> slot) & 1U) << side;
    return bits;
  }
  template <std::size_t kSlots>
  NextGroup read_group(const std::byte*& at) const {
    const auto& group = group_at<kSlots>(at);
    for (std::size_t slot = 0; slot < kSlots; ++slot)
      if (!group.box(slot).empty()) visit_(group.links[slot], group.box(slot), seen_of(group, slot));
    at += sizeof(BoxGroup<kSlots>);
    return group.next;
  }
  bool read_tree(const std::byte* groups, std::uint32_t link, const Bounds3f& outer, std::uint32_t seen,
                 std::size_t depth) const {
    const auto& group = group_at<8>(groups + std::size_t(tree_link::index(link)) * sizeof(BoxGroup<8>));
    for (std::size_t slot = 0; slot < 8; ++slot) {
      const Bounds3f box = group.box(slot);
      if (box.empty()) continue;
      const std::uint32_t bits = seen_of(group, slot);
      if (!outer.contains(box) || (seen & ~bits) != 0 || depth >= kMaxTreeDepth) return false;
      if (tree_link::is_leaf(link)) {
        visit_(group.links[slot], box, bits);
      } else if (!read_tree(groups, group.links[slot], box, bits, depth + 1)) {
        return false;
      }
    }
    return true;
  }

  const Visit& visit_;
};

}  // namespace gridcast::tlas
