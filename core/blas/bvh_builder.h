#pragma once

#include <stop_token>
#include <vector>

#include "core/blas/bvh_node.h"
#include "core/blas/bvh_split.h"

namespace gridcast::blas {

struct BvhBuildConfig {
  BvhSplit split = BvhSplit::kBinnedSah;
  /// Leaves never hold more. The binned split stops earlier where the cost model says so.
  std::size_t max_leaf_size = 4;
  /// Subtrees over more references than this are built as tasks of their own; at least max_leaf_size. No
  /// effect on the tree.
  std::size_t task_size = 4096;
};

/// Builds top down in parallel on the calling arena. The tree depends on the references and the config
/// alone: not on the number of threads, nor on timing. Consumes `references` (reordered, then freed). Boxes
/// are finite, within 2e18 and free of -0. kCancelled on `stop`; kLimitExceeded above kMaxBvhPrimitives.
[[nodiscard]] Result<BvhTree> build_bvh(std::vector<BuildReference> references, const BvhBuildConfig& config,
                                        std::stop_token stop);

}  // namespace gridcast::blas
