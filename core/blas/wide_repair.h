#pragma once
// Selective rebuilding of a refitted wide tree: subtrees that have become worse than they were at build are
// built anew, as in "Ray Tracing Dynamic Scenes using Selective Restructuring", S.-E. Yoon, 2007. Unlike the
// paper, which restructures pairs of nodes that overlap, whole subtrees are built by surface-area cost, and
// which ones is the best choice for what the tree gains over what it costs to build.

#include <memory>

#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

/// What WideBvh::repair does.
struct WideRepair {
  RepairOutcome outcome = RepairOutcome::kUnneeded;
  std::shared_ptr<const WideBvh> tree;  ///< of kRepaired
  std::size_t triangles = 0;            ///< built anew; of kRebuild those that should be
  std::size_t subtrees = 0;
  double fresh_cost = 0.0;  ///< of kRepaired: what `tree` would cost if no part was worse than when built
};

/// With more than this share of the triangles to build anew a whole build is better.
inline constexpr double kMaxRepairShare = 0.4;

}  // namespace gridcast::blas
