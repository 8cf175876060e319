#pragma once

#include <span>
#include <vector>

#include "core/tlas/box_group.h"

namespace gridcast::tlas {

/// Groups of the tree of a crowded cell with that many instances.
[[nodiscard]] std::size_t cell_tree_size(std::size_t instances);

/// Makes trees; one per thread, so that its scratch memory is used again.
class CellTreeBuilder {
 public:
  /// Writes the tree of a crowded cell: eight children a node, split at medians of the box centres so that
  /// every leaf but the last is full. The root is the first of `groups`, cell_tree_size() many; links count
  /// from it. O(n log n).
  void build(std::span<const BoxRecord* const> records, const Cell& cell, std::span<BoxGroup<8>> groups);

 private:
  /// What the splits look at: twice the centre of a box, and its place among the records.
  struct Item {
    float center[3];
    std::uint32_t record;
  };
  /// The link to what holds some items, with their box and the `seen` bits that all of them share.
  struct Built {
    std::uint32_t link;
    Bounds3f box;
    std::uint32_t seen;
  };
  Built build(std::span<Item> items);
  Built leaf(std::span<const Item> items);
  Built node(std::span<Item> items);
  static void partition(std::span<Item> items, const std::size_t* begins, std::size_t first,
                        std::size_t last);

  std::vector<Item> items_;
  std::span<const BoxRecord* const> records_;
  Cell cell_{};
  std::span<BoxGroup<8>> groups_;
  std::size_t used_ = 0;  ///< of groups_
};

/// Levels of a tree over any number of references that fits an id.
inline constexpr std::size_t kMaxTreeDepth = 16;

}  // namespace gridcast::tlas
