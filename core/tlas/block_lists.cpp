#include "core/tlas/block_lists.h"

#include <algorithm>
#include <bit>
#include <memory>
#include <utility>

#include <tbb/parallel_for.h>

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
        filing_(layout),
        tasks_(task_count(boxes.size(), layout.block_count())),
        first_block_(std::make_unique_for_overwrite<std::uint32_t[]>(boxes.size() + kChunk)) {}

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
      count_chunk(task, first, boxes_.chunk(first).data(), size);
    }
  }

  /// First one block of each box, then the others of those that are in several, since whether a box is in one
  /// alone is guessed wrong time and again.
  void count_chunk(Task& task, std::size_t first, const InstanceBox* chunk, std::size_t size) {
    BlockFiling::Corners corners;
    std::uint32_t* const first_block = first_block_.get() + first;
    std::uint64_t in_several = filing_.file(chunk, size, first_block, corners, task.summary);
    std::uint32_t* const counts = task.next.data();
    for (std::size_t k = 0; k < size; ++k)
      if (first_block[k] != kNoBlock) ++counts[first_block[k]];
    for (; in_several != 0; in_several &= in_several - 1) {
      const auto k = std::size_t(std::countr_zero(in_several));
      filing_.for_each_other(corners, k, [&](std::uint32_t block) {
        ++counts[block];
        task.others.push_back({block, std::uint32_t(first + k)});
      });
    }
  }

  const GridLayout& layout_;
  const BoxTable& boxes_;
  BlockFiling filing_;
  std::vector<Task> tasks_;
  std::unique_ptr<std::uint32_t[]> first_block_;  ///< by id, for whole chunks
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
