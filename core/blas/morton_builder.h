#pragma once

#include <stop_token>

#include "core/blas/bvh_node.h"
#include "core/blas/bvh_split.h"

namespace gridcast::blas {

/// A binary tree in nearly linear time: triangles in Morton order, small subtrees by the highest bit in which
/// codes differ ("Fast BVH Construction on GPUs", C. Lauterbach, 2009), and above them a tree over those
/// subtrees by binned surface-area cost, as in "HLBVH: Hierarchical LBVH Construction for Real-Time Ray
/// Tracing of Dynamic Geometry", J. Pantaleoni, 2010. Unlike the papers subtrees end at a number of triangles
/// rather than of bits, so a crowded corner has as many as it needs.
///
/// In parallel on the calling arena; the tree depends on the mesh alone. No leaf is deeper than kMaxBvhDepth,
/// whatever the input, nor larger than four triangles. kCancelled on `stop`; kLimitExceeded above
/// kMaxBvhPrimitives.
[[nodiscard]] Result<BvhTree> build_morton_bvh(const mesh::TriangleMesh& mesh, std::stop_token stop);

}  // namespace gridcast::blas
