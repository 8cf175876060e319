#pragma once

#include <stop_token>

#include "core/blas/bvh_node.h"
#include "core/blas/bvh_split.h"

namespace gridcast::blas {

struct BvhBuildConfig {
  BvhSplit split = BvhSplit::kBinnedSah;
  /// Leaves never hold more. The binned split stops earlier where the cost model says so.
  std::size_t max_leaf_size = 4;
  LeafBlock block = LeafBlock::kOne;
  /// Subtrees over more references than this are built as tasks of their own; at least max_leaf_size. No
  /// effect on the tree.
  std::size_t task_size = 4096;
  /// Triangles may be referenced from several leaves where boxes overlap much.
  SpatialSplits spatial = SpatialSplits::kNever;
};

/// With spatial splits a tree has at most this many references a triangle.
inline constexpr double kMaxReferenceGrowth = 1.5;

/// Builds top down in parallel on the calling arena. The tree depends on the mesh and the config alone: not
/// on the number of threads, nor on timing. kCancelled on `stop`; kLimitExceeded above kMaxBvhPrimitives.
[[nodiscard]] Result<BvhTree> build_bvh(const mesh::TriangleMesh& mesh, const BvhBuildConfig& config,
                                        std::stop_token stop);

/// The same over boxes alone, by binned surface-area cost: a leaf for each, which holds its place in `boxes`.
[[nodiscard]] Result<BvhTree> build_bvh(std::span<const BuildReference> boxes, std::stop_token stop);

}  // namespace gridcast::blas
