#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

void GridLayout::prepare() {
  center = bounds.center();
  slack = rounding_slack(reach, bounds);
  outward = 0x1p-25 * max_abs(bounds.extent()) + 0x1p-120;
  for (int axis = 0; axis < 3; ++axis) {
    shift[axis] = 0;
    blocks[axis] = cells[axis];
  }
  for (std::uint32_t bit = 0; bit < kBlockBits; ++bit) {
    // Double the block along the axis with most blocks: flat grids get flat blocks, small grids small ones.
    const int longest =
        blocks[0] >= blocks[1] ? (blocks[0] >= blocks[2] ? 0 : 2) : (blocks[1] >= blocks[2] ? 1 : 2);
    if (blocks[longest] == 1) break;
    ++shift[longest];
    blocks[longest] = ((cells[longest] - 1) >> shift[longest]) + 1;
  }
  first_of_rows = first_of_layers = 0;
  for (std::uint32_t y = 0; y < (1U << shift[1]); ++y) first_of_rows |= std::uint64_t(1) << (y << shift[0]);
  for (std::uint32_t z = 0; z < (1U << shift[2]); ++z)
    first_of_layers |= std::uint64_t(1) << (z << (shift[0] + shift[1]));
}

CellRange GridLayout::cells_of_block(std::uint32_t block) const {
  CellRange range;
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t first = (block % blocks[axis]) << shift[axis];
    block /= blocks[axis];
    const std::uint32_t last = std::min(first + (1U << shift[axis]), cells[axis]) - 1;
    range.lower[std::size_t(axis)] = std::uint16_t(first);
    range.upper[std::size_t(axis)] = std::uint16_t(last);
  }
  return range;
}

}  // namespace gridcast::tlas
