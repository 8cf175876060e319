#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/blas/bvh_node.h"
#include "core/math/uninitialized_allocator.h"

namespace gridcast::blas {

/// One slot of a wide node before it is laid out: a subtree of the binary tree, as a wide node or as a leaf.
struct WideSlot {
  std::uint32_t binary_node;
  bool leaf;
};

/// Of one wide node.
struct WideSlots {
  std::array<WideSlot, 8> at{};
  std::uint32_t size = 0;
  void add(const WideSlot& slot) { at[size++] = slot; }
};

/// An any-hit ray looks into the first slot before the others, and a leaf costs least to look into and ends
/// the walk: a triangle that covers the mesh is then found at once.
void put_largest_leaf_first(const BvhTree& tree, WideSlots& slots);

/// How to turn a binary tree into one of eight children at the least surface-area cost.
/// "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", H. Ylitie, 2017: cost(n, k) is
/// the least cost of covering the subtree of n with at most k slots. Unlike the paper leaves cost by blocks
/// of four.
class WideCollapse {
 public:
  /// In parallel. Subtrees of at most `max_leaf` primitives may become leaves, and leaves of the tree do.
  WideCollapse(const BvhTree& tree, std::uint32_t max_leaf);

  /// The slots of the wide node that stands for the binary inner node `node`.
  [[nodiscard]] WideSlots slots(std::uint32_t node) const;
  /// Whether the whole subtree is best kept as one leaf.
  [[nodiscard]] bool is_leaf(std::uint32_t node) const { return leaf_[node] != 0; }
  /// Triangles below `node`, contiguous in the tree's primitive order from first_primitive().
  [[nodiscard]] std::uint32_t primitive_count(std::uint32_t node) const { return count_[node]; }
  [[nodiscard]] std::uint32_t first_primitive(std::uint32_t node) const { return first_[node]; }

 private:
  static constexpr int kSlots = 8;
  /// cost_[n][k - 1] with k slots, k = 1 .. 7.
  using Costs = std::array<float, kSlots - 1>;

  void solve(std::uint32_t node);
  void solve_subtree(std::size_t self, std::size_t begin, std::size_t end);
  [[nodiscard]] int best_left(std::uint32_t node, int slots) const;
  void gather(std::uint32_t node, int slots, WideSlots& out) const;

  const BvhTree& tree_;
  std::uint32_t max_leaf_;
  template <class T>
  using Column = std::vector<T, UninitializedAllocator<T>>;
  Column<Costs> cost_;
  Column<std::uint32_t> count_;
  Column<std::uint32_t> first_;
  Column<std::uint8_t> leaf_;
};

}  // namespace gridcast::blas
