#pragma once

#include "core/blas/kd_tree_node.h"
#include "core/blas/kd_treelet.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::blas {

/// Gathers the nodes of a binary kd-tree into treelets, those that rays meet most often first.
[[nodiscard]] KdLayout lay_out(const KdTreeData& tree, const mesh::TriangleMesh& mesh);

}  // namespace gridcast::blas
