#include "core/tlas/uniform_grid.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/tlas/block_builder.h"
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

/// Instances by the blocks that they reach into, each block's ascending.
class BlockLists {
 public:
  // A counting sort without atomics: one histogram per task, so that the order within a block is that of the
  // ids whatever the threads do.
  BlockLists(const GridLayout& layout, const BoxTable& boxes)
      : layout_(layout),
        boxes_(boxes),
        tasks_(task_count(boxes.size(), layout.block_count())),
        table_(boxes.size()) {
    const std::size_t blocks = layout.block_count();
    std::vector<std::vector<std::uint32_t>> next(tasks_);
    std::vector<float> drifts(tasks_, 0.F);
    std::vector<std::size_t> filed(tasks_, 0);
    tbb::parallel_for(std::size_t(0), tasks_, [&](std::size_t task) {
      next[task].resize(blocks, 0);
      std::tie(filed[task], drifts[task]) = count(task, next[task]);
    });
    max_drift_ = *std::max_element(drifts.begin(), drifts.end());
    filed_ = std::accumulate(filed.begin(), filed.end(), std::size_t(0));
    starts_.resize(blocks + 1);
    std::uint32_t total = 0;
    for (std::size_t block = 0; block < blocks; ++block) {
      starts_[block] = total;
      for (std::size_t task = 0; task < tasks_; ++task) total += std::exchange(next[task][block], total);
    }
    starts_[blocks] = total;
    ids_.resize(total);
    tbb::parallel_for(std::size_t(0), tasks_, [&](std::size_t task) {
      for (std::size_t i = begin(task); i < begin(task + 1); ++i)
        for_each_block(records()[i].range,
                       [&](std::size_t block) { ids_[next[task][block]++] = std::uint32_t(i); });
    });
  }

  [[nodiscard]] std::span<const std::uint32_t> operator[](std::size_t block) const {
    return {ids_.data() + starts_[block], ids_.data() + starts_[block + 1]};
  }
  [[nodiscard]] std::span<const BoxRecord> records() const { return table_.records(); }  ///< by id
  [[nodiscard]] float max_drift() const { return max_drift_; }
  [[nodiscard]] std::size_t filed() const { return filed_; }  ///< instances in any block

 private:
  /// Whole chunks of the table of boxes.
  [[nodiscard]] std::size_t begin(std::size_t task) const {
    constexpr std::size_t kChunk = BoxTable::kChunkSize;
    const std::size_t chunks = (boxes_.size() + kChunk - 1) / kChunk;
    return std::min(chunks * task / tasks_ * kChunk, boxes_.size());
  }

  /// Makes the records of a task's instances and counts them by block; returns how many are filed, and the
  /// largest drift of these.
  std::pair<std::size_t, float> count(std::size_t task, std::vector<std::uint32_t>& counts) {
    std::size_t filed = 0;
    float max_drift = 0.F;
    for (std::size_t first = begin(task); first < begin(task + 1); first += BoxTable::kChunkSize) {
      const std::size_t size = std::min(BoxTable::kChunkSize, boxes_.size() - first);
      const std::span<const InstanceBox> boxes = boxes_.chunk(first).first(size);
      if (first + size < begin(task + 1))
        for (const InstanceBox& next : boxes_.chunk(first + size)) __builtin_prefetch(&next);
      write_records(layout_, boxes, std::uint32_t(first), table_.at(first));
      for (std::size_t k = 0; k < size; ++k) {
        const CellRange& range = records()[first + k].range;
        if (range.empty()) continue;
        max_drift = std::max(max_drift, boxes[k].drift);
        ++filed;
        for_each_block(range, [&](std::size_t block) { ++counts[block]; });
      }
    }
    return {filed, max_drift};
  }

  template <class Visit>
  void for_each_block(const CellRange& range, const Visit& visit) const {
    layout_.blocks_of(range).for_each([&](const Cell& block) {
      visit((block[2] * std::size_t(layout_.blocks[1]) + block[1]) * layout_.blocks[0] + block[0]);
    });
  }

  const GridLayout& layout_;
  const BoxTable& boxes_;
  std::size_t tasks_;
  RecordTable table_;
  std::vector<std::uint32_t> starts_, ids_;
  float max_drift_ = 0.F;
  std::size_t filed_ = 0;
};

constexpr std::size_t kBlocksPerTask = 4;

/// Calls make(builder, k) for 0 .. count - 1 in parallel, with copies of `builder`.
template <class Make>
void make_in_parallel(std::size_t count, const BlockBuilder& builder, const Make& make) {
  using Range = tbb::blocked_range<std::size_t>;
  tbb::parallel_for(Range(0, count, kBlocksPerTask), [&](const Range& range) {
    BlockBuilder own(builder);
    for (std::size_t k = range.begin(); k < range.end(); ++k) make(own, k);
  });
}

}  // namespace

// Counting sorts, no atomics: instances by block, then within each block by cell.
UniformGrid::UniformGrid(const GridLayout& layout, const BoxTable& boxes) : layout_(layout) {
  const std::size_t blocks = layout_.block_count();
  blocks_.grow(blocks);
  const BlockLists lists(layout_, boxes);
  max_drift_ = lists.max_drift();
  filed_at_build_ = lists.filed();
  make_in_parallel(blocks, BlockBuilder(layout_, boxes, lists.records()),
                   [&](BlockBuilder& builder, std::size_t b) {
                     if (!lists[b].empty()) blocks_.write(b) = builder.make(std::uint32_t(b), lists[b]);
                   });
  for (std::size_t b = 0; b < blocks; ++b) count_in(blocks_[b].get());
}

void UniformGrid::count_in(const GridBlock* block) {
  if (block == nullptr) return;
  reference_count_ += block->reference_count();
  block_bytes_ += block->memory_bytes();
  tree_count_ += block->tree_count();
  occupied_cells_ += std::size_t(std::popcount(block->occupancy()));
}

void UniformGrid::count_out(const GridBlock* block) {
  if (block == nullptr) return;
  reference_count_ -= block->reference_count();
  block_bytes_ -= block->memory_bytes();
  tree_count_ -= block->tree_count();
  occupied_cells_ -= std::size_t(std::popcount(block->occupancy()));
}

namespace {

/// A change of what a block lists.
struct ListEdit {
  std::uint32_t block, instance_id;
  bool listed;          ///< afterwards
  std::uint64_t cells;  ///< of the block that list the instance before or after
};

std::vector<ListEdit> list_edits(const GridLayout& layout, std::span<const RangeChange> changes) {
  std::vector<ListEdit> edits;
  for (const RangeChange& change : changes) {
    const CellRange before = layout.blocks_of(change.before), after = layout.blocks_of(change.after);
    const auto cells_in = [&](const CellRange& range, std::uint32_t block) {
      return layout.bits_of(range.intersection(layout.cells_of_block(block)));
    };
    const auto index_of = [&](const Cell& block) {
      return (block[2] * layout.blocks[1] + block[1]) * layout.blocks[0] + block[0];
    };
    before.for_each([&](const Cell& block) {
      if (after.contains(block)) return;
      const std::uint32_t index = index_of(block);
      edits.push_back({index, change.instance_id, false, cells_in(change.before, index)});
    });
    after.for_each([&](const Cell& block) {
      const std::uint32_t index = index_of(block);
      const std::uint64_t left = before.contains(block) ? cells_in(change.before, index) : 0;
      edits.push_back({index, change.instance_id, true, left | cells_in(change.after, index)});
    });
  }
  std::sort(edits.begin(), edits.end(), [](const ListEdit& a, const ListEdit& b) {
    return std::tie(a.block, a.instance_id) < std::tie(b.block, b.instance_id);
  });
  return edits;
}

/// What a block lists after the edits; both are ascending, and an edit takes the place of the id it names.
std::vector<std::uint32_t> merged(std::span<const std::uint32_t> ids, std::span<const ListEdit> edits) {
  std::vector<std::uint32_t> listed;
  listed.reserve(ids.size() + edits.size());
  auto id = ids.begin();
  for (const ListEdit& edit : edits) {
    while (id != ids.end() && *id < edit.instance_id) listed.push_back(*id++);
    if (id != ids.end() && *id == edit.instance_id) ++id;
    if (edit.listed) listed.push_back(edit.instance_id);
  }
  listed.insert(listed.end(), id, ids.end());
  return listed;
}

/// A block after the edits; null stands for one without instances.
std::shared_ptr<const GridBlock> edited(BlockBuilder& builder, const GridBlock* old,
                                        std::span<const ListEdit> edits) {
  const std::uint32_t index = edits[0].block;
  if (old == nullptr) return builder.make(index, merged({}, edits));
  std::uint64_t cells = 0;
  for (const ListEdit& edit : edits) cells |= edit.cells;
  const std::vector<std::uint32_t> listed = merged(old->listed(), edits);
  const DirtyCells dirty(*old, cells);
  // Where most of the block changes, filing all is cheaper than finding out what stays.
  if (2 * dirty.references > old->reference_count()) return builder.make(index, listed);
  return builder.patch(index, *old, dirty, merged(dirty.ids, edits), listed);
}

}  // namespace

void UniformGrid::apply(std::span<const RangeChange> changes, const BoxTable& boxes) {
  for (const RangeChange& change : changes)
    if (!change.after.empty()) max_drift_ = std::max(max_drift_, boxes[change.instance_id].drift);
  const std::vector<ListEdit> edits = list_edits(layout_, changes);
  std::vector<std::size_t> begins;  // of each block's edits
  for (std::size_t i = 0; i < edits.size(); ++i)
    if (i == 0 || edits[i].block != edits[i - 1].block) begins.push_back(i);
  begins.push_back(edits.size());

  std::vector<std::shared_ptr<const GridBlock>> made(begins.size() - 1);
  make_in_parallel(made.size(), BlockBuilder(layout_, boxes), [&](BlockBuilder& builder, std::size_t k) {
    const std::span<const ListEdit> here(edits.data() + begins[k], edits.data() + begins[k + 1]);
    made[k] = edited(builder, block(here[0].block), here);
  });
  for (std::size_t k = 0; k < made.size(); ++k) {
    const std::uint32_t index = edits[begins[k]].block;
    count_out(block(index));
    count_in(made[k].get());
    blocks_.write(index) = std::move(made[k]);
  }
}

}  // namespace gridcast::tlas
