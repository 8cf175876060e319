#pragma once

#include <algorithm>

#include "core/blas/block_bounds.h"
#include "core/blas/compact_node.h"
#include "core/blas/triangle_block.h"

namespace gridcast::blas {

/// A compact tree with the mesh that its leaves name triangles of; see wide_view.h.
struct CompactView {
  const CompactNode* nodes;
  const std::uint32_t* ids;
  const mesh::Triangle* triangles;
  const Vec3f* positions;

  [[nodiscard]] static std::uint32_t child(const CompactNode& node, std::uint32_t slot) {
    return compact_child::of(node, slot);
  }
  [[nodiscard]] static std::uint32_t slot_count(const CompactNode& node) { return node.slot_count(); }
  /// Calls visit(block) until it returns false; false then.
  template <class Visit>
  bool for_blocks(std::uint32_t link, const Visit& visit) const {
    const std::uint32_t count = compact_child::count(link);
    for (std::uint32_t begin = 0; begin < count; begin += 4) {
      TriangleBlock block;
      name_triangles(ids + compact_child::first_id(link) + begin, count - begin, block);
      load_corners(triangles, positions, block);
      if (!visit(block)) return false;
    }
    return true;
  }
  [[nodiscard]] static std::uint32_t leaf_number(std::uint32_t link) { return compact_child::first_id(link); }

  /// The first four of `count` ids; the last one again where they are fewer.
  static void name_triangles(const std::uint32_t* from, std::uint32_t count, TriangleBlock& block) {
    for (std::uint32_t lane = 0; lane < 4; ++lane) block.ids[lane] = from[std::min(lane, count - 1)];
  }
};

/// A bit per slot that a slab test may let pass: the planes of unused slots mean nothing.
[[nodiscard]] inline std::uint32_t used_slots(const CompactNode& node) {
  return (1U << node.slot_count()) - 1;
}

}  // namespace gridcast::blas
