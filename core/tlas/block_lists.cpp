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
        ranges_(std::make_unique_for_overwrite<PackedRange[]>(boxes.size())) {}

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
      for (std::size_t i = begin(task); i < begin(task + 1); ++i)
        for_each_block(std::bit_cast<CellRange>(ranges_[i]),
                       [&](std::size_t block) { ids[next[block]++] = std::uint32_t(i); });
    });
  }

 private:
  /// Whole chunks of the table of boxes.
  [[nodiscard]] std::size_t begin(std::size_t task) const {
    constexpr std::size_t kChunk = BoxTable::kChunkSize;
    const std::size_t chunks = (boxes_.size() + kChunk - 1) / kChunk;
    return std::min(chunks * task / tasks_ * kChunk, boxes_.size());
  }

  void count(std::size_t task) {
    std::vector<std::uint32_t>& counts = next_[task];
    counts.resize(layout_.block_count(), 0);
    FilingSummary& part = parts_[task];
    const BoxFiling filing(layout_);
    for (std::size_t first = begin(task); first < begin(task + 1); first += BoxTable::kChunkSize) {
      const std::size_t size = std::min(BoxTable::kChunkSize, boxes_.size() - first);
      const std::span<const InstanceBox> boxes = boxes_.chunk(first).first(size);
      if (first + size < begin(task + 1))
        for (const InstanceBox& next : boxes_.chunk(first + size)) __builtin_prefetch(&next);
      filing.find_ranges(boxes, &ranges_[first], part.bounds);
      for (std::size_t k = 0; k < size; ++k) {
        part.reachable += std::size_t(!boxes[k].bounds.empty());
        const auto range = std::bit_cast<CellRange>(ranges_[first + k]);
        if (range.empty()) continue;
        ++part.filed;
        part.max_drift = std::max(part.max_drift, boxes[k].drift);
        part.references += range.cell_count();
        for_each_block(range, [&](std::size_t block) { ++counts[block]; });
      }
    }
  }

  /// Most boxes are in one block.
  template <class Visit>
  void for_each_block(const CellRange& range, const Visit& visit) const {
    if (range.empty()) return;
    const CellRange blocks = layout_.blocks_of(range);
    const auto index_of = [&](const Cell& block) {
      return (block[2] * std::size_t(layout_.blocks[1]) + block[1]) * layout_.blocks[0] + block[0];
    };
    if (blocks.lower == blocks.upper) {
      visit(index_of(blocks.lower));
    } else {
      blocks.for_each([&](const Cell& block) { visit(index_of(block)); });
    }
  }

  const GridLayout& layout_;
  const BoxTable& boxes_;
  std::size_t tasks_;
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

}  // namespace gridcast::tlas
