#pragma once

#include <stop_token>

#include "core/blas/kd_tree_node.h"
#include "core/error.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::blas {

/// Builds top down in parallel on the calling arena; the tree depends on the mesh alone, not on the number
/// of threads. kCancelled on `stop`; kLimitExceeded above kMaxKdTriangles.
[[nodiscard]] Result<KdTreeData> build_kd_tree(const mesh::TriangleMesh& mesh, std::stop_token stop);

}  // namespace gridcast::blas
