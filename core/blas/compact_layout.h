#pragma once

#include "core/blas/compact_node.h"
#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

struct CompactLayout {
  CompactNodes nodes;
  std::vector<std::uint32_t> ids;
};

/// The same tree in compact form. It depends on the tree alone. kLimitExceeded: see CompactBvh::build.
[[nodiscard]] Result<CompactLayout> compacted(const WideBvh& tree);

}  // namespace gridcast::blas
