#pragma once
// The lowest nodes of a wide tree in Morton order: nodes without inner children, made of the sorted keys.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/blas/morton_ranges.h"
#include "core/blas/wide_bvh.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::blas {

/// A cluster has at most twelve blocks in eight slots. With 32 or 64 instead trees cost up to 10 % more (S1
/// to S6): nodes that are not full, or leaves that are too large.
inline constexpr std::uint32_t kClusterTriangles = 48;

/// Triangles that follow each other along the Morton curve and become one node, or one leaf.
struct WideCluster {
  std::uint32_t first_key = 0;
  std::uint32_t first_block = 0;
  std::uint32_t slots = 0;
  std::array<std::uint8_t, 8> ends{};  ///< of the slots' keys, counted from first_key

  [[nodiscard]] bool is_leaf() const { return slots == 1; }
};

/// All clusters of a mesh, in the order of the curve.
struct WideClusters {
  std::vector<WideCluster> all;
  std::uint32_t block_count = 0;
  /// What fill() makes: the node of each, which of a leaf has one slot, and its box.
  WideNodes nodes;
  std::vector<BuildReference> boxes;

  /// Divides the keys into clusters and those into slots, in parallel. Every cluster has as few blocks as
  /// hold its triangles; within that, slots end where the curve leaves a cell.
  explicit WideClusters(std::span<const MortonKey> keys);

  /// Writes block_count blocks, with the corners of their triangles, and the nodes that link to them.
  void fill(std::span<const MortonKey> keys, const mesh::TriangleMesh& mesh, TriangleBlocks& blocks);
};

}  // namespace gridcast::blas
