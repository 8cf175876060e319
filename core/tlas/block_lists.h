#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/tlas/block_filing.h"

namespace gridcast::tlas {

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
