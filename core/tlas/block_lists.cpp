#include "core/tlas/block_lists.h"

#include <algorithm>
#include <bit>
#include <memory>
#include <utility>

#include <tbb/parallel_for.h>

#include "core/tlas/box_filing.h"

namespace gridcast::tlas {
namespace {

/// Tasks of the counting sort, each with a histogram: so many instances each at least, and all histograms
/// together with no more entries than twice the instances.
constexpr std::size_t kInstancesPerTask = 1024;
constexpr std::size_t kMaxTasks = 64;

constexpr std::size_t kChunk = BoxTable::kChunkSize;

std::size_t task_count(std::size_t instances, std::size_t blocks) {
  return std::clamp<std::size_t>(std::min(instances / kInstancesPerTask, 2 * instances / blocks), 1,
                                 kMaxTasks);
}

void add(FilingSummary& sum, const FilingSummary& part) {
  sum.bounds.extend(part.bounds);
  sum.reachable += part.reachable;
  sum.filed += part.filed;
  sum.references += part.references;
  sum.max_drift = std::max(sum.max_drift, part.max_drift);
}

/// A counting sort without atomics: one histogram per task, so that the order within a block is that of the
/// ids whatever the threads do.
class Sort {
 public:
  Sort(const GridLayout& layout, const BoxTable& boxes)
      : layout_(layout),
        boxes_(boxes),
        tasks_(task_count(boxes.size(), layout.block_count())),
        next_(tasks_),
        parts_(tasks_),
        ranges_(std::make_unique_for_overwrite<PackedRange[]>(boxes.size())) {
    for (std::size_t plane = 0; plane < 6; ++plane) shift_[plane] = layout.shift[plane % 3];
  }

  /// Counts every task's instances by block.
  void count() {
    tbb::parallel_for(std::size_t(0), tasks_, [&](std::size_t task) { count(task); });
  }
  [[nodiscard]] FilingSummary summary() const {
    FilingSummary sum;
    for (const FilingSummary& part : parts_) add(sum, part);
    return sum;
  }
  /// Where each block's ids begin, and where all end.
  [[nodiscard]] std::vector<std::uint32_t> starts() {
    const std::size_t blocks = layout_.block_count();
    std::vector<std::uint32_t> starts(blocks + 1);
    std::uint32_t total = 0;
    for (std::size_t block = 0; block < blocks; ++block) {
      starts[block] = total;
      for (std::size_t task = 0; task < tasks_; ++task) total += std::exchange(next_[task][block], total);
    }
    starts[blocks] = total;
    return starts;
  }
  /// After starts().
  void place(std::vector<std::uint32_t>& ids) {
    tbb::parallel_for(std::size_t(0), tasks_, [&](std::size_t task) {
      std::uint32_t* const next = next_[task].data();
      for_each_chunk(task, [&](std::size_t first, std::size_t size) {
        visit_blocks(first, size,
                     [&](std::size_t i, std::size_t block) { ids[next[block]++] = std::uint32_t(i); });
      });
    });
  }

 private:
  /// Whole chunks of the table of boxes.
  [[nodiscard]] std::size_t begin(std::size_t task) const {
    const std::size_t chunks = (boxes_.size() + kChunk - 1) / kChunk;
    return std::min(chunks * task / tasks_ * kChunk, boxes_.size());
  }

  template <class Visit>
  void for_each_chunk(std::size_t task, const Visit& visit) const {
    for (std::size_t first = begin(task); first < begin(task + 1); first += kChunk)
      visit(first, std::min(kChunk, boxes_.size() - first));
  }

  void count(std::size_t task) {
    std::vector<std::uint32_t>& counts = next_[task];
    counts.resize(layout_.block_count(), 0);
    FilingSummary& part = parts_[task];
    const BoxFiling filing(layout_);
    for_each_chunk(task, [&](std::size_t first, std::size_t size) {
      const std::span<const InstanceBox> boxes = boxes_.chunk(first).first(size);
      if (first + size < begin(task + 1))
        for (const InstanceBox& next : boxes_.chunk(first + size)) __builtin_prefetch(&next);
      filing.find_ranges(boxes, &ranges_[first], part.bounds);
      for (std::size_t k = 0; k < size; ++k) {
        part.reachable += std::size_t(!boxes[k].bounds.empty());
        const PackedRange& range = ranges_[first + k];
        if (range[0] > range[3]) continue;
        ++part.filed;
        part.max_drift = std::max(part.max_drift, boxes[k].drift);
        part.references += std::bit_cast<CellRange>(range).cell_count();
      }
      visit_blocks(first, size, [&](std::size_t /*i*/, std::size_t block) { ++counts[block]; });
    });
  }

  /// Calls visit(i, block) for all blocks of the boxes of a chunk: first one block of each box, then the
  /// others of those that are in several, since whether a box is in one alone is guessed wrong time and
  /// again. The lower and the upper corner of the blocks of a range, and the number of the first of these.
  struct Blocks {
    std::uint32_t corners[6];
    std::uint32_t first;
  };
  [[nodiscard]] Blocks blocks_of(const PackedRange& range) const {
    Blocks blocks;
    for (std::size_t plane = 0; plane < 6; ++plane)
      blocks.corners[plane] = std::uint32_t(range[plane]) >> shift_[plane];
    blocks.first = index_of(blocks.corners[0], blocks.corners[1], blocks.corners[2]);
    return blocks;
  }
  [[nodiscard]] std::uint32_t index_of(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return (z * layout_.blocks[1] + y) * layout_.blocks[0] + x;
  }

  /// Calls visit(i, block) for all blocks of the boxes of a chunk: first one block of each box, then the
  /// others of those that are in several, since whether a box is in one alone is guessed wrong time and
  /// again.
  template <class Visit>
  void visit_blocks(std::size_t first, std::size_t size, const Visit& visit) const {
    std::uint64_t in_several = 0;
    for (std::size_t k = 0; k < size; ++k) {
      const PackedRange& range = ranges_[first + k];
      if (range[0] > range[3]) continue;  // empty
      const Blocks blocks = blocks_of(range);
      const std::uint32_t *const lower = blocks.corners, *const upper = blocks.corners + 3;
      visit(first + k, blocks.first);
      const std::uint32_t differ = (lower[0] ^ upper[0]) | (lower[1] ^ upper[1]) | (lower[2] ^ upper[2]);
      in_several |= std::uint64_t(differ != 0) << k;
    }
    for (; in_several != 0; in_several &= in_several - 1) {
      const std::size_t i = first + std::size_t(std::countr_zero(in_several));
      const Blocks blocks = blocks_of(ranges_[i]);
      for (std::uint32_t z = blocks.corners[2]; z <= blocks.corners[5]; ++z)
        for (std::uint32_t y = blocks.corners[1]; y <= blocks.corners[4]; ++y)
          for (std::uint32_t x = blocks.corners[0]; x <= blocks.corners[3]; ++x)
            if (const std::uint32_t block = index_of(x, y, z); block != blocks.first) visit(i, block);
    }
  }

  const GridLayout& layout_;
  const BoxTable& boxes_;
  std::size_t tasks_;
  std::uint32_t shift_[6];  ///< log2 of a block's cells, by the numbers of a PackedRange
  std::vector<std::vector<std::uint32_t>> next_;  ///< of each task: how many, then where the next id goes
  std::vector<FilingSummary> parts_;
  std::unique_ptr<PackedRange[]> ranges_;  ///< by id
};

}  // namespace

BlockLists::BlockLists(const GridLayout& layout, const BoxTable& boxes) {
  Sort sort(layout, boxes);
  sort.count();
  summary_ = sort.summary();
  starts_ = sort.starts();
  for (std::size_t block = 0; block + 1 < starts_.size(); ++block) {
    const double listed = double(starts_[block + 1] - starts_[block]);
    summary_.crowding += listed * listed;
  }
  ids_.resize(starts_.back());
  sort.place(ids_);
}

// By insertion, since hardly an id has far to go.
std::vector<std::uint32_t> BlockLists::operator[](std::size_t block) const {
  std::vector<std::uint32_t> ids(ids_.data() + starts_[block], ids_.data() + starts_[block + 1]);
  for (std::size_t k = 1; k < ids.size(); ++k) {
    const std::uint32_t id = ids[k];
    std::size_t place = k;
    for (; place > 0 && ids[place - 1] > id; --place) ids[place] = ids[place - 1];
    ids[place] = id;
  }
  return ids;
}

}  // namespace gridcast::tlas
