#pragma once
// Which subtrees of a refitted wide tree are worth building anew.

#include <cstdint>
#include <span>
#include <vector>

#include "core/blas/triangle_block.h"
#include "core/blas/wide_parts.h"

namespace gridcast::blas {

/// What is in a part, or below it.
struct PartSize {
  double triangle_area = 0.0;  ///< half, of the boxes of the triangles, summed up
  double box_area = 0.0;       ///< half, of the box of the part's first node
  std::uint32_t triangles = 0;
};

/// Of one part's own nodes.
[[nodiscard]] PartSize part_size(const WideNodes& nodes, const TriangleBlocks& blocks, const WidePart& part);
/// Of every part, in parallel; the sums do not depend on the number of threads.
[[nodiscard]] std::vector<PartSize> part_sizes(const WideNodes& nodes, const TriangleBlocks& blocks,
                                               const WideParts& parts);
/// The same of everything below each part, itself included.
[[nodiscard]] std::vector<PartSize> sizes_below(const WideParts& parts, std::span<const PartSize> own);

/// What a part costs by its size, in two ways, as scene::worsening compares trees: neither changes where the
/// tree stays good, whatever happens to sizes. 0 where there is nothing to measure by.
struct PartLooseness {
  double by_triangles = 0.0;  ///< cost for every unit of the area of the triangles below
  double by_box = 0.0;        ///< cost for every unit of the area of its box
};
[[nodiscard]] std::vector<PartLooseness> part_looseness(std::span<const double> part_costs,
                                                        std::span<const PartSize> below);

/// What each part would cost if it was as good as when its looseness was taken, by the stricter of both ways;
/// never more than it does cost.
[[nodiscard]] std::vector<double> fresh_costs(std::span<const PartLooseness> looseness,
                                              std::span<const PartSize> below,
                                              std::span<const double> part_costs);

/// A subtree: all nodes from `begin` to `end`.
struct WideRange {
  std::uint32_t begin, end;
};

struct Damage {
  std::vector<WideRange> subtrees;  ///< to build anew, ascending, none within another; the root = everything
  std::size_t triangles = 0;        ///< in these
};

/// The set of disjoint subtrees for which what they cost more than fresh ones, less a price for each triangle
/// that is built anew, is largest in sum. Overlap between subtrees counts where they meet, so damage at the
/// top of the tree chooses the root.
[[nodiscard]] Damage find_damage(const WideParts& parts, std::span<const double> part_costs,
                                 std::span<const double> fresh_costs, std::span<const PartSize> below);

}  // namespace gridcast::blas
