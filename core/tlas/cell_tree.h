#pragma once

#include <span>
#include <vector>

#include <oneapi/tbb/cache_aligned_allocator.h>

#include "core/tlas/box_group.h"

namespace gridcast::tlas {

using TreeGroups = std::vector<BoxGroup<8>, oneapi::tbb::cache_aligned_allocator<BoxGroup<8>>>;

/// Appends the tree of a crowded cell: eight children a node, split at medians of the box centres so that
/// every leaf but the last is full. The root is the first group appended; links count from it. `records` is
/// reordered. O(n log n).
void append_cell_tree(std::span<const BoxRecord*> records, const Cell& cell, TreeGroups& groups);

/// Levels of a tree over any number of references that fits an id.
inline constexpr std::size_t kMaxTreeDepth = 16;

}  // namespace gridcast::tlas
