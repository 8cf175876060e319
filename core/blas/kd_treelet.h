#pragma once
// A kd-tree as it is traversed: treelets of one cache line, leaves of indexed blocks, every triangle once.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <oneapi/tbb/cache_aligned_allocator.h>

#include "core/blas/kd_tree_node.h"
#include "core/math/bounds.h"

namespace gridcast::blas {

/// The top of a kd-subtree: up to eight planes that part its cell into up to eight children, 64 bytes. What
/// would be 17 nodes of a binary tree (children without triangles have no slot) is one cache line and one
/// SIMD step. A child's cell is the treelet's cut by at most four half spaces, which `path` names.
struct alignas(64) KdTreelet {
  static constexpr std::uint32_t kSlots = 8;
  static constexpr std::uint32_t kPlanes = 8;
  static constexpr std::uint32_t kSides = 4;       ///< half spaces of a slot
  static constexpr std::uint32_t kMaxBlocks = 15;  ///< of a leaf; more make a treelet without planes

  float planes[kPlanes];        ///< +infinity where unused: everything lies below
  std::uint16_t path[kSlots];   ///< four half spaces of 4 bits: plane, and 8 for the side above it
  std::uint16_t axes;           ///< 2 bits a plane
  std::uint8_t used, inner;     ///< a bit a slot
  std::uint32_t block_counts;   ///< 4 bits a slot; 0 for inner and unused ones
  std::uint32_t first_treelet;  ///< inner children follow each other in the order of slots
  std::uint32_t first_block;    ///< leaves' blocks likewise

  [[nodiscard]] bool is_used(std::uint32_t slot) const { return ((used >> slot) & 1) != 0; }
  [[nodiscard]] bool is_inner(std::uint32_t slot) const { return ((inner >> slot) & 1) != 0; }
  [[nodiscard]] int axis(std::uint32_t plane) const { return (axes >> (2 * plane)) & 3; }
  [[nodiscard]] std::uint32_t block_count(std::uint32_t slot) const {
    return (block_counts >> (4 * slot)) & 15;
  }
  /// The inner child in `slot`.
  [[nodiscard]] std::uint32_t child(std::uint32_t slot) const {
    return first_treelet + std::uint32_t(std::popcount(std::uint32_t(inner) & ((1U << slot) - 1U)));
  }
  /// The first block of the leaf in `slot`: the sum of the counts before it, at most 7 * 15.
  [[nodiscard]] std::uint32_t block(std::uint32_t slot) const {
    const std::uint32_t before = block_counts & ~(~0U << (4 * slot));
    const std::uint32_t pairs = (before & 0x0F0F0F0FU) + ((before >> 4) & 0x0F0F0F0FU);
    return first_block + ((pairs * 0x01010101U) >> 24);
  }
  /// The part of the treelet's `cell` that belongs to `slot`.
  [[nodiscard]] Bounds3f child_cell(std::uint32_t slot, Bounds3f cell) const {
    for (std::uint32_t side = 0; side < kSides; ++side) {
      const std::uint32_t code = (std::uint32_t(path[slot]) >> (4 * side)) & 15U;
      const float plane = planes[code & 7U];
      const int across = axis(code & 7U);
      if ((code & 8U) != 0)
        cell.lower[across] = std::max(cell.lower[across], plane);
      else
        cell.upper[across] = std::min(cell.upper[across], plane);
    }
    return cell;
  }
};
static_assert(sizeof(KdTreelet) == 64);

/// Four triangles of a leaf, as numbers in KdLayout::triangles. A block that is not full repeats its last
/// one.
struct alignas(16) KdBlock {
  std::uint32_t triangles[4];

  /// Different triangles.
  [[nodiscard]] std::uint32_t size() const {
    std::uint32_t count = 4;
    while (count > 1 && triangles[count - 1] == triangles[count - 2]) --count;
    return count;
  }
};

/// A triangle and its id. Leaves that share it share this copy; neighbours in space lie close in memory.
struct KdTriangle {
  float corners[9];  ///< x, y, z of each
  std::uint32_t id;

  [[nodiscard]] Vec3f corner(std::size_t number) const {
    return {corners[3 * number], corners[3 * number + 1], corners[3 * number + 2]};
  }
};
static_assert(sizeof(KdTriangle) == 40);

/// A treelet on the way down leaves at most seven entries behind. Every treelet holds at least one level of
/// the binary tree, or shares a pile of at most 7 * 2^26 triangles among eight, down to kMaxBlocks.
inline constexpr std::size_t kKdStackSize = 7 * (kMaxKdDepth + 10) + 8;

using KdTreelets = std::vector<KdTreelet, oneapi::tbb::cache_aligned_allocator<KdTreelet>>;
using KdBlocks = std::vector<KdBlock, oneapi::tbb::cache_aligned_allocator<KdBlock>>;
using KdTriangles = std::vector<KdTriangle, oneapi::tbb::cache_aligned_allocator<KdTriangle>>;

/// One step to a treelet, and one block of four triangles that have to be gathered, in triangle tests.
inline constexpr double kTreeletCost = 2.0;
inline constexpr double kIndexedBlockCost = 1.0;

/// A treelet's cell is the part of `bounds` that its ancestors' planes leave to it, closed on every side.
/// Every point of a triangle lies in a leaf that lists the triangle.
struct KdLayout {
  Bounds3f bounds;
  KdTreelets treelets;  ///< treelets[0] is the root; parents before children; empty without triangles
  KdBlocks blocks;
  KdTriangles triangles;  ///< those that a leaf lists, in the order of their first leaf
};

}  // namespace gridcast::blas
