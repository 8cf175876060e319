#pragma once

#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

/// Without a slot: eight inverted boxes.
[[nodiscard]] WideNode empty_node();
/// What two slots hold, exchanged.
void swap_slots(WideNode& node, std::uint32_t a, std::uint32_t b);

/// Collapses a binary tree and lays it out depth first: a node's inner children follow it, the first one at
/// once. In parallel; the result depends on the tree alone. Corners are loaded from the mesh.
void lay_out(const BvhTree& tree, const mesh::TriangleMesh& mesh, WideNodes& nodes, TriangleBlocks& blocks);

}  // namespace gridcast::blas
