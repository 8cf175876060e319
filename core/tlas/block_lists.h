#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

/// What filing boxes in a grid shows of all of them.
struct FilingSummary {
  Bounds3d bounds;               ///< of all boxes
  std::size_t reachable = 0;     ///< boxes that are not empty
  std::size_t filed = 0;         ///< of these, inside the grid
  std::uint64_t references = 0;  ///< boxes counted once per cell that lists them
  double crowding = 0.0;         ///< sum over the blocks of the square of how many boxes each lists
  float max_drift = 0.F;         ///< of the boxes that are filed
};

/// Instances by the blocks that they reach into.
class BlockLists {
 public:
  /// Linear time, parallel, and the same whatever the number of threads.
  BlockLists(const GridLayout& layout, const BoxTable& boxes);

  /// Those of a block, ascending.
  [[nodiscard]] std::vector<std::uint32_t> operator[](std::size_t block) const;
  [[nodiscard]] bool empty(std::size_t block) const { return starts_[block] == starts_[block + 1]; }
  [[nodiscard]] const FilingSummary& summary() const { return summary_; }
  [[nodiscard]] std::size_t memory_bytes() const {
    return (starts_.capacity() + ids_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  std::vector<std::uint32_t> starts_;
  std::vector<std::uint32_t> ids_;  ///< by block; of ids from one chunk of the boxes, in any order
  FilingSummary summary_;
};

}  // namespace gridcast::tlas
