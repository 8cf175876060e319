#pragma once

#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

/// Collapses a binary tree and lays it out depth first: a node's inner children follow it, the first one at
/// once. In parallel; the result depends on the tree alone. Corners are loaded from the mesh.
void lay_out(const BvhTree& tree, const mesh::TriangleMesh& mesh, WideNodes& nodes, TriangleBlocks& blocks);

}  // namespace gridcast::blas
