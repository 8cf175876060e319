#pragma once

#include <array>

#include "core/blas/refit_memory.h"

namespace gridcast::blas {

/// kStreaming goes past the caches: for trees that do not fit them, where a line that is written whole need
/// not be read first.
enum class RefitStores : std::uint8_t { kCached, kStreaming };

struct RefitJob {
  const BlockCorners* corners;
  const Vec3f* positions;
  const WideNode* links;  ///< the tree whose links and slots count
  WideNode* nodes;        ///< may be those of `links`; else links are copied
  TriangleBlock* blocks;
};

/// Boxes of the nodes of one part are handed up; `cost` is that of WideCostSum.
struct RefitResult {
  PaddedBox box;
  double cost;
};

/// Draws a subtree anew: corners into its blocks, boxes into its nodes, every byte written once, in order.
RefitResult refit_subtree(const RefitJob& job, const WidePart& part, RefitStores stores);
/// Draws one node from the boxes of its inner children, slot by slot, and its leaves.
RefitResult refit_node(const RefitJob& job, std::uint32_t node, const std::array<PaddedBox, 8>& children);

}  // namespace gridcast::blas
