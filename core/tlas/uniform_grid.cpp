#include "core/tlas/uniform_grid.h"

#include <algorithm>
#include <utility>

#include <tbb/parallel_for.h>

namespace gridcast::tlas {
namespace {

/// Instances per task of the counting sort; bounds the number of histograms too.
constexpr std::size_t kInstancesPerTask = 16384;
constexpr std::size_t kMaxTasks = 64;

/// The part of `range` inside `clip`; both are not empty and overlap.
CellRange intersection(const CellRange& range, const CellRange& clip) {
  CellRange both;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    both.lower[axis] = std::max(range.lower[axis], clip.lower[axis]);
    both.upper[axis] = std::min(range.upper[axis], clip.upper[axis]);
  }
  return both;
}

}  // namespace

void UniformGrid::set_blocks() {
  for (std::uint32_t bit = 0; bit < kBlockBits; ++bit) {
    // Double the block along the axis with most blocks: flat grids get flat blocks, small grids small ones.
    const auto blocks = [&](int axis) { return ((layout_.cells[axis] - 1) >> shift_[axis]) + 1; };
    const int longest =
        blocks(0) >= blocks(1) ? (blocks(0) >= blocks(2) ? 0 : 2) : (blocks(1) >= blocks(2) ? 1 : 2);
    if (blocks(longest) == 1) break;
    ++shift_[longest];
  }
  std::size_t count = 1;
  for (int axis = 0; axis < 3; ++axis) {
    blocks_per_axis_[axis] = ((layout_.cells[axis] - 1) >> shift_[axis]) + 1;
    count *= blocks_per_axis_[axis];
  }
  blocks_.grow(count);
}

CellRange UniformGrid::blocks_of(const CellRange& range) const {
  CellRange blocks;
  if (range.empty()) return blocks;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    blocks.lower[axis] = std::uint16_t(range.lower[axis] >> shift_[axis]);
    blocks.upper[axis] = std::uint16_t(range.upper[axis] >> shift_[axis]);
  }
  return blocks;
}

CellRange UniformGrid::cells_of_block(std::uint32_t index) const {
  CellRange cells;
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t first = (index % blocks_per_axis_[axis]) << shift_[axis];
    index /= blocks_per_axis_[axis];
    const std::uint32_t last = std::min(first + (1U << shift_[axis]), layout_.cells[axis]) - 1;
    cells.lower[std::size_t(axis)] = std::uint16_t(first);
    cells.upper[std::size_t(axis)] = std::uint16_t(last);
  }
  return cells;
}

std::shared_ptr<const GridBlock> UniformGrid::make_block(std::uint32_t index,
                                                         std::span<const std::uint32_t> listed,
                                                         std::span<const CellRange> ranges) const {
  const CellRange cells = cells_of_block(index);
  const auto for_each_reference = [&](const auto& visit) {
    for (const std::uint32_t id : listed)
      intersection(ranges[id], cells).for_each([&](const Cell& cell) { visit(address(cell).local, id); });
  };
  auto block = std::make_shared<GridBlock>();
  std::vector<std::uint32_t>& first = block->first;
  first.assign(cells_per_block() + 1, 0);
  for_each_reference([&](std::uint32_t local, std::uint32_t) { ++first[local + 1]; });
  for (std::size_t c = 1; c < first.size(); ++c) first[c] += first[c - 1];
  block->ids.resize(first.back());
  // Filling moves the start of each cell to that of the next one, so the starts are shifted back afterwards.
  for_each_reference([&](std::uint32_t local, std::uint32_t id) { block->ids[first[local]++] = id; });
  std::rotate(first.begin(), first.end() - 1, first.end());
  first.front() = 0;
  return block;
}

// Two counting sorts, no atomics: instances by block (one histogram per task, so that the order within a
// block is that of the ids whatever the threads do), then within each block by cell.
UniformGrid::UniformGrid(const GridLayout& layout, std::span<const CellRange> ranges) : layout_(layout) {
  set_blocks();
  const std::size_t blocks = blocks_.size();
  const std::size_t tasks = std::clamp<std::size_t>(ranges.size() / kInstancesPerTask, 1, kMaxTasks);
  std::vector<std::vector<std::uint32_t>> starts(tasks, std::vector<std::uint32_t>(blocks, 0));
  const auto for_each_block = [&](std::size_t task, const auto& visit) {
    const std::size_t end = ranges.size() * (task + 1) / tasks;
    for (std::size_t i = ranges.size() * task / tasks; i < end; ++i) {
      blocks_of(ranges[i]).for_each([&](const Cell& block) {
        visit((block[2] * std::size_t(blocks_per_axis_[1]) + block[1]) * blocks_per_axis_[0] + block[0],
              std::uint32_t(i));
      });
    }
  };
  tbb::parallel_for(std::size_t(0), tasks, [&](std::size_t task) {
    for_each_block(task, [&](std::size_t block, std::uint32_t) { ++starts[task][block]; });
  });

  std::vector<std::uint32_t> block_starts(blocks + 1, 0);
  std::uint32_t total = 0;
  for (std::size_t block = 0; block < blocks; ++block) {
    block_starts[block] = total;
    for (std::size_t task = 0; task < tasks; ++task) total += std::exchange(starts[task][block], total);
  }
  block_starts[blocks] = total;

  std::vector<std::uint32_t> ids(total);
  tbb::parallel_for(std::size_t(0), tasks, [&](std::size_t task) {
    for_each_block(task, [&](std::size_t block, std::uint32_t id) { ids[starts[task][block]++] = id; });
  });

  // Chunks of the block table are written by one task each.
  constexpr std::size_t kBlocksPerTask = decltype(blocks_)::kChunkSize;
  tbb::parallel_for(std::size_t(0), (blocks + kBlocksPerTask - 1) / kBlocksPerTask, [&](std::size_t task) {
    for (std::size_t b = task * kBlocksPerTask; b < std::min(blocks, (task + 1) * kBlocksPerTask); ++b) {
      const std::span<const std::uint32_t> listed(ids.data() + block_starts[b],
                                                  ids.data() + block_starts[b + 1]);
      if (listed.empty()) continue;
      blocks_.write(b) = make_block(std::uint32_t(b), listed, ranges);
    }
  });
  for (std::size_t b = 0; b < blocks; ++b) {
    if (blocks_[b] == nullptr) continue;
    ++used_blocks_;
    reference_count_ += blocks_[b]->ids.size();
  }
}

}  // namespace gridcast::tlas
