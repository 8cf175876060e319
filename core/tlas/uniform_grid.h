#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/math/chunked_vector.h"
#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

/// log2 of the most cells in a block: large enough that a table of blocks is small, small enough that copying
/// one for an update is cheap (2 KiB and its references).
inline constexpr std::uint32_t kBlockBits = 9;

/// A box of cells with their lists, in compressed rows: cell c lists ids[first[c]] .. ids[first[c + 1] - 1],
/// ascending. Immutable once shared.
struct GridBlock {
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> ids;

  [[nodiscard]] std::span<const std::uint32_t> list(std::uint32_t local_cell) const {
    return {ids.data() + first[local_cell], ids.data() + first[local_cell + 1]};
  }
};

/// An instance that changes its cells.
struct RangeChange {
  std::uint32_t instance_id;
  CellRange before, after;
};

/// The cells of a uniform grid, in blocks that copies share. A block without instances is null.
class UniformGrid {
 public:
  UniformGrid() = default;
  /// ranges[i] are the cells of instance i. Parallel, and the same whatever the number of threads.
  UniformGrid(const GridLayout& layout, std::span<const CellRange> ranges);

  /// Files instances anew; copies the blocks they leave or enter and no others. Each instance at most once.
  void apply(std::span<const RangeChange> changes);

  [[nodiscard]] const GridLayout& layout() const { return layout_; }

  struct CellAddress {
    std::uint32_t block, local;
  };
  [[nodiscard]] CellAddress address(const Cell& cell) const {
    std::uint32_t block = 0, local = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const std::uint32_t index = cell[std::size_t(axis)];
      block = block * blocks_per_axis_[axis] + (index >> shift_[axis]);
      local = (local << shift_[axis]) | (index & ((1U << shift_[axis]) - 1U));
    }
    return {block, local};
  }
  /// Null when nothing is in the block.
  [[nodiscard]] const GridBlock* block(std::uint32_t index) const { return blocks_[index].get(); }
  [[nodiscard]] std::size_t block_count() const { return blocks_.size(); }
  [[nodiscard]] std::uint32_t cells_per_block() const { return 1U << (shift_[0] + shift_[1] + shift_[2]); }

  [[nodiscard]] std::uint64_t reference_count() const { return reference_count_; }
  [[nodiscard]] std::size_t memory_bytes() const;
  /// `references`: cells in all ranges together. Every instance is in exactly the cells of its range.
  [[nodiscard]] Status validate(const ChunkedVector<Entry>& entries, std::uint64_t references) const;
  /// The cells of a block that are inside the grid.
  [[nodiscard]] CellRange cells_of_block(std::uint32_t index) const;

 private:
  struct CellEdit {
    std::uint32_t block, local, instance_id;
    bool listed;  // afterwards
  };
  void set_blocks();
  [[nodiscard]] CellRange blocks_of(const CellRange& range) const;
  /// The lists of block `index`, from the ids of all instances that reach into it, ascending.
  [[nodiscard]] std::shared_ptr<const GridBlock> make_block(std::uint32_t index,
                                                            std::span<const std::uint32_t> listed,
                                                            std::span<const CellRange> ranges) const;
  void edit_block(std::uint32_t index, std::span<const CellEdit> edits);

  GridLayout layout_;
  std::uint32_t shift_[3] = {0, 0, 0};  ///< log2 of a block's cells along each axis
  std::uint32_t blocks_per_axis_[3] = {0, 0, 0};
  ChunkedVector<std::shared_ptr<const GridBlock>, 64> blocks_;
  std::uint64_t reference_count_ = 0;
  std::size_t used_blocks_ = 0;
};

}  // namespace gridcast::tlas
