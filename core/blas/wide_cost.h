#pragma once
// The surface-area cost of a wide tree, added up so that it is the same bits whoever computes it: the
// builder, a refit on any number of threads and instruction set, or a patch that looks at a few parts.

#include <span>

#include "core/blas/cost_model.h"
#include "core/blas/wide_parts.h"

namespace gridcast::blas {

/// Half areas of boxes times what it costs to look at what they hold, slot by slot.
struct WideCostSum {
  double slots[8] = {};

  /// `planes` as in a WideNode.
  void add(const float (&planes)[2][3][8], const std::uint32_t (&child)[8], std::uint32_t used) {
    for (std::uint32_t slot = 0; slot < 8; ++slot) {
      const double x = double(planes[1][0][slot]) - double(planes[0][0][slot]);
      const double y = double(planes[1][1][slot]) - double(planes[0][1][slot]);
      const double z = double(planes[1][2][slot]) - double(planes[0][2][slot]);
      const double weighted = weight(child[slot]) * (x * y + y * z + z * x);
      slots[slot] += slot < used ? weighted : 0.0;
    }
  }
  [[nodiscard]] double sum() const {
    return ((slots[0] + slots[1]) + (slots[2] + slots[3])) + ((slots[4] + slots[5]) + (slots[6] + slots[7]));
  }
  static double weight(std::uint32_t link) {
    if (!wide_child::is_leaf(link)) return kWideNodeCost;
    return wide_child::block_count(link) == 2 ? 2.0 * kBlockCost : kBlockCost;
  }
};

/// Of the nodes of one part, last to first.
[[nodiscard]] double part_cost(const WideNodes& nodes, const WidePart& part);
/// Of every part, in parallel.
[[nodiscard]] std::vector<double> part_costs(const WideNodes& nodes, const WideParts& parts);
/// The tree's cost in triangle tests per random ray that meets the root box, from those of its parts.
[[nodiscard]] double tree_cost(const WideNodes& nodes, std::span<const double> part_costs);

}  // namespace gridcast::blas
