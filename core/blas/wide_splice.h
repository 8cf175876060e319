#pragma once
// A wide tree with some of its subtrees replaced.

#include <span>

#include "core/blas/refit_memory.h"
#include "core/blas/wide_damage.h"

namespace gridcast::blas {

/// A subtree by itself, links relative to its own nodes and blocks, to stand in the place of another.
struct Graft {
  WideRange replaced{};
  WideNodes nodes;
  TriangleBlocks blocks;
};

/// Nodes and blocks of a tree and their corners.
struct WideArrays {
  WideNodes& nodes;
  TriangleBlocks& blocks;
  BlockCornersList& corners;
};

/// Where the nodes of the old tree that stay have gone.
class Splice {
 public:
  /// `grafts` ascending by what they replace, which is disjoint and never the root.
  Splice(const WideNodes& nodes, std::span<const Graft> grafts);

  /// Writes the tree, depth first as any other, at the cost of a copy. In parallel.
  void write(const WideBvh& old, const BlockCornersList& corners, const mesh::TriangleMesh& mesh,
             const WideArrays& out) const;

  /// The place in the old tree of a node of the new one; kGrafted for those of grafts.
  [[nodiscard]] std::uint32_t old_node(std::uint32_t node) const;
  static constexpr std::uint32_t kGrafted = ~0U;

 private:
  /// Neighbouring nodes that go together: some that stay, or a graft.
  struct Piece {
    WideRange old;
    const Graft* graft;
    std::uint32_t node, block;  ///< where its own go
  };

  void add(const WideRange& old, const Graft* graft);
  void place(const WideNodes& nodes);
  [[nodiscard]] std::uint32_t new_node(std::uint32_t old) const;
  void copy_kept(const Piece& piece, const WideBvh& old, const BlockCornersList& corners,
                 const WideArrays& out) const;
  static void copy_graft(const Piece& piece, const mesh::TriangleMesh& mesh, const WideArrays& out);

  std::vector<Piece> pieces_;
  std::uint32_t node_count_ = 0, block_count_ = 0;
};

}  // namespace gridcast::blas
