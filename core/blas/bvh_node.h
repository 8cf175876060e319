#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <oneapi/tbb/cache_aligned_allocator.h>

#include "core/math/bounds.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::blas {

/// 32 bytes, two to a cache line. count == 0: an inner node with children `first` and `first + 1`;
/// otherwise a leaf over [first, first + count) of the tree's primitive order.
struct BvhNode {
  Vec3f lower;
  std::uint32_t first;
  Vec3f upper;
  std::uint32_t count;

  [[nodiscard]] bool leaf() const { return count != 0; }
  [[nodiscard]] Bounds3f bounds() const { return {lower, upper}; }
};
static_assert(sizeof(BvhNode) == 32);

/// nodes[0] is the root, nodes[1] is unused so that siblings share a cache line: pairs start at even
/// indices. Depth first: the pair of an inner node is followed by all pairs below its first child, then by
/// those below its second. Empty for a mesh without triangles.
///
///      0 root | 1 - | 2 A | 3 B | 4 A's children ... | B's children ...
using BvhNodes = std::vector<BvhNode, oneapi::tbb::cache_aligned_allocator<BvhNode>>;

/// What a builder makes: a tree over primitive numbers, in the order its leaves list them.
struct BvhTree {
  BvhNodes nodes;
  std::vector<std::uint32_t> primitive_ids;
};

/// Splits chosen by area or midpoint may go this deep; from there on halves are taken, ceil(log2 n) more.
inline constexpr std::size_t kMaxFreeDepth = 64;
/// 2 n - 1 nodes are numbered with 32 bits.
inline constexpr std::size_t kMaxBvhPrimitives = std::size_t(1) << 31;
/// No leaf lies deeper: 64 free levels, then at most 31 halvings of 2^31 primitives.
inline constexpr std::size_t kMaxBvhDepth = kMaxFreeDepth + 31;

/// The box of a triangle with -0 turned into +0, so that min and max give the same bits in any order.
inline Bounds3f primitive_bounds(const mesh::TriangleMesh& mesh, std::uint32_t id) {
  const Bounds3f box = mesh.triangle_bounds(id);
  return {box.lower + 0.F, box.upper + 0.F};
}

}  // namespace gridcast::blas
