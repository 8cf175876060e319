#include "core/tlas/uniform_grid.h"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

namespace gridcast::tlas {
namespace {

/// Instances per task of the counting sort; bounds the number of histograms too.
constexpr std::size_t kInstancesPerTask = 16384;
constexpr std::size_t kMaxTasks = 64;

/// Instances by the blocks that they reach into, each block's ascending.
class BlockLists {
 public:
  // A counting sort without atomics: one histogram per task, so that the order within a block is that of the
  // ids whatever the threads do.
  BlockLists(const GridLayout& layout, const BoxTable& boxes) : layout_(layout), boxes_(boxes) {
    const std::size_t blocks = layout.block_count();
    tasks_ = std::clamp<std::size_t>(boxes.size() / kInstancesPerTask, 1, kMaxTasks);
    std::vector<std::vector<std::uint32_t>> next(tasks_, std::vector<std::uint32_t>(blocks, 0));
    std::vector<float> drifts(tasks_, 0.F);
    std::vector<std::size_t> filed(tasks_, 0);
    tbb::parallel_for(std::size_t(0), tasks_, [&](std::size_t task) {
      for_each_range(task, [&](std::uint32_t id, const CellRange& range) {
        drifts[task] = std::max(drifts[task], boxes[id].drift);
        ++filed[task];
        for_each_block(range, [&](std::size_t block) { ++next[task][block]; });
      });
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
      for_each_range(task, [&](std::uint32_t id, const CellRange& range) {
        for_each_block(range, [&](std::size_t block) { ids_[next[task][block]++] = id; });
      });
    });
  }

  [[nodiscard]] std::span<const std::uint32_t> operator[](std::size_t block) const {
    return {ids_.data() + starts_[block], ids_.data() + starts_[block + 1]};
  }
  [[nodiscard]] float max_drift() const { return max_drift_; }
  [[nodiscard]] std::size_t filed() const { return filed_; }  ///< instances in any block

 private:
  template <class Visit>
  void for_each_range(std::size_t task, const Visit& visit) const {
    const std::size_t end = boxes_.size() * (task + 1) / tasks_;
    for (std::size_t i = boxes_.size() * task / tasks_; i < end; ++i) {
      const CellRange range = layout_.range_of(boxes_[i]);
      if (!range.empty()) visit(std::uint32_t(i), range);
    }
  }
  template <class Visit>
  void for_each_block(const CellRange& range, const Visit& visit) const {
    layout_.blocks_of(range).for_each([&](const Cell& block) {
      visit((block[2] * std::size_t(layout_.blocks[1]) + block[1]) * layout_.blocks[0] + block[0]);
    });
  }

  const GridLayout& layout_;
  const BoxTable& boxes_;
  std::size_t tasks_ = 1;
  std::vector<std::uint32_t> starts_, ids_;
  float max_drift_ = 0.F;
  std::size_t filed_ = 0;
};

}  // namespace

// Counting sorts, no atomics: instances by block, then within each block by cell.
UniformGrid::UniformGrid(const GridLayout& layout, const BoxTable& boxes) : layout_(layout) {
  const std::size_t blocks = layout_.block_count();
  blocks_.grow(blocks);
  const BlockLists lists(layout_, boxes);
  max_drift_ = lists.max_drift();
  filed_at_build_ = lists.filed();
  // Chunks of the block table are written by one task each.
  constexpr std::size_t kBlocksPerTask = decltype(blocks_)::kChunkSize;
  tbb::parallel_for(std::size_t(0), (blocks + kBlocksPerTask - 1) / kBlocksPerTask, [&](std::size_t task) {
    BlockBuilder builder(layout_, boxes);
    for (std::size_t b = task * kBlocksPerTask; b < std::min(blocks, (task + 1) * kBlocksPerTask); ++b)
      if (!lists[b].empty()) blocks_.write(b) = builder.make(std::uint32_t(b), lists[b]);
  });
  for (std::size_t b = 0; b < blocks; ++b) count_in(blocks_[b].get());
}

void UniformGrid::count_in(const GridBlock* block) {
  if (block == nullptr) return;
  reference_count_ += block->reference_count();
  block_bytes_ += block->memory_bytes();
  tree_count_ += block->tree_count();
}

void UniformGrid::count_out(const GridBlock* block) {
  if (block == nullptr) return;
  reference_count_ -= block->reference_count();
  block_bytes_ -= block->memory_bytes();
  tree_count_ -= block->tree_count();
}

void UniformGrid::apply(std::span<const RangeChange> changes, const BoxTable& boxes) {
  struct Edit {
    std::uint32_t block, instance_id;
    bool listed;  // afterwards
  };
  std::vector<Edit> edits;
  for (const RangeChange& change : changes) {
    const CellRange before = layout_.blocks_of(change.before), after = layout_.blocks_of(change.after);
    const auto add_edits = [&](const CellRange& range, bool listed) {
      range.for_each([&](const Cell& block) {
        if (!listed && after.contains(block)) return;
        const std::uint32_t index = (block[2] * layout_.blocks[1] + block[1]) * layout_.blocks[0] + block[0];
        edits.push_back({index, change.instance_id, listed});
      });
    };
    add_edits(before, false);
    add_edits(after, true);
    if (!after.empty()) max_drift_ = std::max(max_drift_, boxes[change.instance_id].drift);
  }
  std::sort(edits.begin(), edits.end(), [](const Edit& a, const Edit& b) {
    return std::tie(a.block, a.instance_id) < std::tie(b.block, b.instance_id);
  });

  BlockBuilder builder(layout_, boxes);
  std::vector<std::uint32_t> listed;
  for (auto edit = edits.begin(); edit != edits.end();) {
    const std::uint32_t index = edit->block;
    const GridBlock* old = block(index);
    const auto old_ids = old != nullptr ? old->listed() : std::span<const std::uint32_t>{};
    // Merge the two ascending sequences; an edit takes the place of the id it names.
    listed.clear();
    auto id = old_ids.begin();
    for (; edit != edits.end() && edit->block == index; ++edit) {
      while (id != old_ids.end() && *id < edit->instance_id) listed.push_back(*id++);
      if (id != old_ids.end() && *id == edit->instance_id) ++id;
      if (edit->listed) listed.push_back(edit->instance_id);
    }
    listed.insert(listed.end(), id, old_ids.end());
    count_out(old);
    blocks_.write(index) = builder.make(index, listed);
    count_in(block(index));
  }
}

}  // namespace gridcast::tlas
