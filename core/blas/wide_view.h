#pragma once
// What traversals and walks see of a tree of eight children a node, whatever its layout: a view has
//   nodes, an array by inner link;  child(node, slot), a link;  slot_count(node);
//   for_blocks(link, visit), the triangles of a leaf in blocks of four;
// and is_leaf() of wide_child holds for its links.

#include <cstdint>

#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

struct WideView {
  const WideNode* nodes;
  const TriangleBlock* blocks;

  [[nodiscard]] static std::uint32_t child(const WideNode& node, std::uint32_t slot) {
    return node.child[slot];
  }
  [[nodiscard]] static std::uint32_t slot_count(const WideNode& node) { return node.slots; }
  /// Calls visit(block) until it returns false; false then.
  template <class Visit>
  bool for_blocks(std::uint32_t link, const Visit& visit) const {
    const TriangleBlock* const first = blocks + wide_child::index(link);
    for (const TriangleBlock* block = first; block != first + wide_child::block_count(link); ++block)
      if (!visit(*block)) return false;
    return true;
  }
  /// What names a leaf beside its node: its first block.
  [[nodiscard]] static std::uint32_t leaf_number(std::uint32_t link) { return wide_child::index(link); }
};

[[nodiscard]] inline WideView view_of(const WideBvh& tree) {
  return {tree.nodes().data(), tree.blocks().data()};
}

/// A bit per slot that a slab test may let pass: an unused slot's box is inverted, which does that alone.
[[nodiscard]] constexpr std::uint32_t used_slots(const WideNode& /*node*/) {
  return 0xFFU;
}

/// Different triangles of a block: one that is not full repeats its last.
[[nodiscard]] inline std::uint32_t triangles_in(const TriangleBlock& block) {
  std::uint32_t count = 4;
  while (count > 1 && block.ids[count - 1] == block.ids[count - 2]) --count;
  return count;
}

}  // namespace gridcast::blas
