#pragma once
// A node of the compact tree: boxes as bytes on a grid of the node's own.

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "core/math/bounds.h"
#include "core/math/uninitialized_allocator.h"

namespace gridcast::blas {

/// 80 bytes, two cache lines at most. "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
/// BVHs", H. Ylitie, 2017, has the layout: planes as bytes relative to the node's origin, in steps of a power
/// of two an axis, children in a row, triangles in a row. Changed: inner children come before leaves, so that
/// their number says which are which; a leaf is known by where it ends, and holds up to eight triangles;
/// slots are in the order of the tree, not sorted for octants of directions, since the traversal sorts by
/// distance; a plane is decoded before it is intersected, not in terms of the ray.
///
/// A plane stands for float(origin + q * step). The product is exact, as q has 8 bits and the step is a power
/// of two not below 2^-126, so the sum is rounded once and has the same bits with and without FMA, on every
/// instruction set. Rounding is monotone, hence so is the plane in q, and set_boxes() chooses q by the plane
/// as it will be decoded: lower planes at or below the float box's, upper ones at or above.
/// So a decoded box contains the float box, and every ray that passes the slab test of the one passes
/// that of the other ("The slab test is monotone", core/README.md).
struct alignas(16) CompactNode {
  std::uint8_t planes[2][3][8];  ///< [lower, upper][axis][slot]
  float origin[3];
  std::uint8_t exponents[3];  ///< of the steps, biased by 127 as in a float; never 0 or 255
  std::uint8_t counts;        ///< inner children, and 16 times the used slots
  std::uint32_t first_child;  ///< index of the inner child in slot 0; the others follow it
  std::uint32_t first_id;     ///< of the leaves' triangles, which follow each other by slot
  std::uint8_t ends[8];       ///< of each leaf's triangles, counted from first_id; 0 for an inner child

  [[nodiscard]] std::uint32_t inner_count() const { return counts & 0xFU; }
  [[nodiscard]] std::uint32_t slot_count() const { return std::uint32_t(counts) >> 4U; }
  [[nodiscard]] float step(int axis) const {
    return std::bit_cast<float>(std::uint32_t(exponents[axis]) << 23U);
  }
  [[nodiscard]] float plane(int side, int axis, std::uint32_t slot) const {
    return origin[axis] + float(planes[side][axis][slot]) * step(axis);
  }
  [[nodiscard]] Bounds3f box(std::uint32_t slot) const {
    return {{plane(0, 0, slot), plane(0, 1, slot), plane(0, 2, slot)},
            {plane(1, 0, slot), plane(1, 1, slot), plane(1, 2, slot)}};
  }

  /// Origin, steps and planes, around the boxes of the used slots: 1 to 8, finite, at most 1e18 in size. -0
  /// becomes +0.
  void set_boxes(std::span<const Bounds3f> boxes);
};
static_assert(sizeof(CompactNode) == 80);

/// Parents before children, siblings in a row: a node's inner children, then all below the first, then all
/// below the second, and so on. A triangle's id is listed once per leaf that holds it, in the order of that
/// walk.
using CompactNodes = std::vector<CompactNode, UninitializedAllocator<CompactNode>>;

/// A child link: an inner node's index, or a leaf of one to eight triangles.
namespace compact_child {
inline constexpr std::uint32_t kLeafBit = 1U << 31U;
inline constexpr std::uint32_t kCountShift = 28;
inline constexpr std::uint32_t kIndexMask = (1U << kCountShift) - 1;
inline std::uint32_t leaf(std::uint32_t first, std::uint32_t count) {
  return kLeafBit | ((count - 1) << kCountShift) | first;
}
inline std::uint32_t first_id(std::uint32_t link) {
  return link & kIndexMask;
}
inline std::uint32_t count(std::uint32_t link) {
  return ((link >> kCountShift) & 7U) + 1;
}
/// Without a branch on the slot: where a leaf begins, the one before it ends.
inline std::uint32_t of(const CompactNode& node, std::uint32_t slot) {
  const auto ends = std::bit_cast<std::uint64_t>(node.ends);
  const auto end = std::uint32_t((ends >> (8 * slot)) & 0xFFU);
  const auto begin = std::uint32_t(((ends << 8U) >> (8 * slot)) & 0xFFU);
  return slot < node.inner_count() ? node.first_child + slot : leaf(node.first_id + begin, end - begin);
}
}  // namespace compact_child

}  // namespace gridcast::blas
