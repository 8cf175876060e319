#pragma once

#include <stop_token>

#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

/// A wide tree in nearly linear time, without a binary tree over the triangles: those are sorted along a
/// Morton curve, of which stretches become nodes (wide_clusters.h); above these stands a tree by binned
/// surface-area cost, as in "HLBVH: Hierarchical LBVH Construction for Real-Time Ray Tracing of Dynamic
/// Geometry", J. Pantaleoni, 2010, collapsed to eight children a node. Boxes of triangles are never stored:
/// leaves are drawn around their corners.
///
/// The layout of wide_layout.h, but for the blocks, which follow the curve. In parallel on the calling arena;
/// the tree depends on the mesh alone. No path is longer than kMaxBvhDepth. kCancelled on `stop`. Not for a
/// mesh without triangles, nor for 2^30 or more.
[[nodiscard]] Status build_wide_in_morton_order(const mesh::TriangleMesh& mesh, const std::stop_token& stop,
                                                WideNodes& nodes, TriangleBlocks& blocks);

}  // namespace gridcast::blas
