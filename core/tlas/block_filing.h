#pragma once

#include <cstddef>
#include <cstdint>

#include "core/tlas/grid_layout.h"
#include "core/tlas/instance_box.h"

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

/// Stands for the block of a box that is in none.
inline constexpr std::uint32_t kNoBlock = 0xFFFFFFFF;

/// Finds the blocks of a grid that boxes reach into, several boxes at once: those of GridLayout::range_of,
/// with every instruction set.
class BlockFiling {
 public:
  static constexpr std::size_t kChunk = BoxTable::kChunkSize;
  static_assert(kChunk <= 64, "a bit of each box of a chunk");

  explicit BlockFiling(const GridLayout& layout);

  /// The blocks at the lower and the upper corner of each box, along x, y, z and again; of one that is in
  /// none they mean nothing.
  struct Corners {
    std::uint32_t at[6][kChunk];
  };
  /// Files the first `count` boxes of a whole chunk: writes the number of the block of the lower corner of
  /// each, or kNoBlock, to `first_block`, which has room for a chunk and keeps nothing behind `count`. Adds
  /// all but `crowding` to `summary`. Returns a bit for each box that is in several blocks.
  [[nodiscard]] std::uint64_t file(const InstanceBox* chunk, std::size_t count, std::uint32_t* first_block,
                                   Corners& corners, FilingSummary& summary) const;
  /// Calls visit(block) for all blocks of box k but that of its lower corner.
  template <class Visit>
  void for_each_other(const Corners& corners, std::size_t k, const Visit& visit) const {
    const auto at = [&](std::size_t plane) { return corners.at[plane][k]; };
    const std::uint32_t first_block = number(at(0), at(1), at(2));
    for (std::uint32_t z = at(2); z <= at(5); ++z)
      for (std::uint32_t y = at(1); y <= at(4); ++y)
        for (std::uint32_t x = at(0); x <= at(3); ++x)
          if (const std::uint32_t block = number(x, y, z); block != first_block) visit(block);
  }

  /// Of the layout, what a kernel needs.
  struct Grid {
    double lower[3], upper[3], inverse_cell[3], last_cell[3];
    double reach, slack;     ///< see GridLayout::pad
    int shift[3];            ///< log2 of a block's cells
    std::int32_t row, rows;  ///< blocks in a row, rows in a layer
  };

 private:
  [[nodiscard]] std::uint32_t number(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return (z * std::uint32_t(grid_.rows) + y) * std::uint32_t(grid_.row) + x;
  }

  Grid grid_;
};

}  // namespace gridcast::tlas
