#pragma once
// Pieces of a binary tree that builders make in parallel, and how they become one.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/blas/bvh_node.h"
#include "core/blas/float4.h"

namespace gridcast::blas {

/// A node with all that is below it. Above the task size it has two children; below, everything sits in
/// `nodes` and `ids` in the final order, with links relative to their starts.
struct Subtree {
  BvhNode root{};
  std::vector<BvhNode> nodes;
  std::vector<std::uint32_t> ids;
  std::unique_ptr<Subtree> children[2];
  std::size_t node_count = 0;  ///< without the root
  std::size_t id_count = 0;

  /// When `nodes` and `ids` are complete.
  void count_own() {
    node_count = nodes.size();
    id_count = ids.size();
  }
  /// When both children are.
  void count_children() {
    node_count = 2 + children[0]->node_count + children[1]->node_count;
    id_count = children[0]->id_count + children[1]->id_count;
  }
};

inline void set_box(BvhNode& node, const Box4& box) {
  const Bounds3f bounds = box.bounds();
  node.lower = bounds.lower;
  node.upper = bounds.upper;
}

/// The tree of `root`, in parallel; pieces are freed on the way.
[[nodiscard]] BvhTree flattened(std::unique_ptr<Subtree> root);

}  // namespace gridcast::blas
