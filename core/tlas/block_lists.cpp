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

/// Stands for the block of a box that is in none.
constexpr std::uint32_t kNoBlock = 0xFFFFFFFF;

/// Where blocks are in the layout.
class BlockNumbers {
 public:
  explicit BlockNumbers(const GridLayout& layout) : row_(layout.blocks[0]), rows_(layout.blocks[1]) {
    for (std::size_t plane = 0; plane < 6; ++plane) shift_[plane] = layout.shift[plane % 3];
  }

  /// The lower and the upper corner of the blocks of a range of cells that is not empty.
  struct Corners {
    std::uint32_t at[6];
    [[nodiscard]] bool several() const { return ((at[0] ^ at[3]) | (at[1] ^ at[4]) | (at[2] ^ at[5])) != 0; }
  };
  [[nodiscard]] Corners corners(const PackedRange& range) const {
    Corners corners;
    for (std::size_t plane = 0; plane < 6; ++plane)
      corners.at[plane] = std::uint32_t(range[plane]) >> shift_[plane];
    return corners;
  }
  [[nodiscard]] std::uint32_t first(const Corners& corners) const {
    return number(corners.at[0], corners.at[1], corners.at[2]);
  }
  /// Calls visit(block) for all but the first.
  template <class Visit>
  void for_each_other(const Corners& corners, const Visit& visit) const {
    const std::uint32_t* const at = corners.at;
    const std::uint32_t first_block = first(corners);
    for (std::uint32_t z = at[2]; z <= at[5]; ++z)
      for (std::uint32_t y = at[1]; y <= at[4]; ++y)
        for (std::uint32_t x = at[0]; x <= at[3]; ++x)
          if (const std::uint32_t block = number(x, y, z); block != first_block) visit(block);
  }

 private:
  [[nodiscard]] std::uint32_t number(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return (z * rows_ + y) * row_ + x;
  }

  std::uint32_t row_, rows_;
  std::uint32_t shift_[6];  ///< log2 of a block's cells, by the numbers of a PackedRange
};

/// A counting sort without atomics: one histogram per task, so that the order within a block is that of the
/// ids whatever the threads do.
class Sort {
 public:
  Sort(const GridLayout& layout, const BoxTable& boxes)
      : layout_(layout),
        boxes_(boxes),
        numbers_(layout),
        filing_(layout),
        tasks_(task_count(boxes.size(), layout.block_count())),
        first_block_(std::make_unique_for_overwrite<std::uint32_t[]>(boxes.size())) {}

  /// Counts every task's instances by block.
  void count() {
    tbb::parallel_for(std::size_t(0), tasks_.size(), [&](std::size_t task) { count(task); });
  }
  [[nodiscard]] FilingSummary summary() const {
    FilingSummary sum;
    for (const Task& task : tasks_) add(sum, task.summary);
    return sum;
  }
  /// Where each block's ids begin, and where all end.
  [[nodiscard]] std::vector<std::uint32_t> starts() {
    const std::size_t blocks = layout_.block_count();
    std::vector<std::uint32_t> starts(blocks + 1);
    std::uint32_t total = 0;
    for (std::size_t block = 0; block < blocks; ++block) {
      starts[block] = total;
      for (Task& task : tasks_) total += std::exchange(task.next[block], total);
    }
    starts[blocks] = total;
    return starts;
  }
  /// After starts().
  void place(std::vector<std::uint32_t>& ids) {
    tbb::parallel_for(std::size_t(0), tasks_.size(), [&](std::size_t k) {
      Task& task = tasks_[k];
      std::uint32_t* const next = task.next.data();
      auto other = task.others.begin();
      for (std::size_t first = begin(k); first < begin(k + 1); first += kChunk) {
        const std::size_t end = std::min(first + kChunk, begin(k + 1));
        for (std::size_t i = first; i < end; ++i)
          if (first_block_[i] != kNoBlock) ids[next[first_block_[i]]++] = std::uint32_t(i);
        for (; other != task.others.end() && other->id < end; ++other) ids[next[other->block]++] = other->id;
      }
    });
  }

 private:
  /// A block that a box is in beside its first one.
  struct Other {
    std::uint32_t block, id;
  };
  struct Task {
    std::vector<std::uint32_t> next;  ///< by block: how many, then where the next id goes
    std::vector<Other> others;        ///< by chunks of the boxes
    FilingSummary summary;
  };

  /// Whole chunks of the table of boxes.
  [[nodiscard]] std::size_t begin(std::size_t task) const {
    const std::size_t chunks = (boxes_.size() + kChunk - 1) / kChunk;
    return std::min(chunks * task / tasks_.size() * kChunk, boxes_.size());
  }

  void count(std::size_t k) {
    Task& task = tasks_[k];
    task.next.resize(layout_.block_count(), 0);
    for (std::size_t first = begin(k); first < begin(k + 1); first += kChunk) {
      const std::size_t size = std::min(kChunk, boxes_.size() - first);
      if (first + size < begin(k + 1))
        for (const InstanceBox& next : boxes_.chunk(first + size)) __builtin_prefetch(&next);
      count_chunk(task, first, boxes_.chunk(first).first(size));
    }
  }

  /// First one block of each box, then the others of those that are in several, since whether a box is in one
  /// alone is guessed wrong time and again.
  void count_chunk(Task& task, std::size_t first, std::span<const InstanceBox> boxes) {
    PackedRange ranges[kChunk];
    filing_.find_ranges(boxes, ranges, task.summary.bounds);
    std::uint32_t* const counts = task.next.data();
    std::uint64_t in_several = 0, references = 0;
    std::size_t reachable = 0, filed = 0;
    float max_drift = task.summary.max_drift;
    for (std::size_t k = 0; k < boxes.size(); ++k) {
      const PackedRange& range = ranges[k];
      reachable += std::size_t(!boxes[k].bounds.empty());
      first_block_[first + k] = kNoBlock;
      if (range[0] > range[3]) continue;
      ++filed;
      max_drift = std::max(max_drift, boxes[k].drift);
      references += std::uint64_t(range[3] - range[0] + 1) * std::uint64_t(range[4] - range[1] + 1) *
                    std::uint64_t(range[5] - range[2] + 1);
      const BlockNumbers::Corners corners = numbers_.corners(range);
      const std::uint32_t block = numbers_.first(corners);
      first_block_[first + k] = block;
      ++counts[block];
      in_several |= std::uint64_t(corners.several()) << k;
    }
    task.summary.reachable += reachable;
    task.summary.filed += filed;
    task.summary.references += references;
    task.summary.max_drift = max_drift;
    for (; in_several != 0; in_several &= in_several - 1) {
      const auto k = std::size_t(std::countr_zero(in_several));
      numbers_.for_each_other(numbers_.corners(ranges[k]), [&](std::uint32_t block) {
        ++counts[block];
        task.others.push_back({block, std::uint32_t(first + k)});
      });
    }
  }

  const GridLayout& layout_;
  const BoxTable& boxes_;
  BlockNumbers numbers_;
  BoxFiling filing_;
  std::vector<Task> tasks_;
  std::unique_ptr<std::uint32_t[]> first_block_;  ///< by id
};
static_assert(kChunk <= 64, "a bit of each box of a chunk");

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
