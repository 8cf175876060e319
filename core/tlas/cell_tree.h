#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/tlas/box_record.h"

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
  /// A coordinate of a box centre in the upper half, ordered like the floats, and the place of the box among
  /// the records in the lower.
  using Key = std::uint64_t;
  /// The link to what holds some instances, with their box and the `seen` bits that all of them share.
  struct Built {
    std::uint32_t link;
    Bounds3f box;
    std::uint32_t seen;
  };
  Built build(std::span<Key> keys);
  Built leaf(std::span<const Key> keys);
  Built node(std::span<Key> keys);
  void partition(std::span<Key> keys, const std::size_t* begins, std::size_t first, std::size_t last);

  std::vector<Key> keys_;
  std::vector<std::array<float, 4>> centers_;  ///< twice the centre of each record's box
  std::span<const BoxRecord* const> records_;
  Cell cell_{};
  std::span<BoxGroup<8>> groups_;
  std::size_t used_ = 0;  ///< of groups_
};

}  // namespace gridcast::tlas
