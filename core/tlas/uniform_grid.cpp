#include "core/tlas/uniform_grid.h"

#include <algorithm>
#include <tuple>
#include <utility>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/tlas/block_builder.h"

namespace gridcast::tlas {
namespace {

constexpr std::size_t kBlocksPerTask = 4;

/// Blocks with more instances are always made in advance, by several threads: a ray would wait for them too
/// long.
constexpr std::size_t kMostListedLate = 16384;

std::int64_t bytes_of(const GridBlock* block) {
  return block == nullptr ? 0 : std::int64_t(block->memory_bytes());
}

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

UniformGrid::UniformGrid(const GridLayout& layout, const BoxTable& boxes, MakeBlocks when) : layout_(layout) {
  const auto source = std::make_shared<BlockSource>(layout_, boxes);
  source_ = source;
  max_drift_ = at_build().max_drift;
  reference_count_ = at_build().references;
  const std::size_t count = layout_.block_count();
  blocks_.grow(count);
  const bool now = when == MakeBlocks::kNow;
  const bool some_are_large = at_build().crowding > double(kMostListedLate) * double(kMostListedLate);
  if (now || some_are_large) {
    const BlockBuilder builder(layout_, source->shape(), boxes, Helpers::kThreads);
    make_in_parallel(count, builder, [&](BlockBuilder& own, std::size_t b) {
      const std::vector<std::uint32_t> listed = source->listed(b);
      if (!listed.empty() && (now || listed.size() > kMostListedLate))
        blocks_.write(b) = BlockSlot(own.make(std::uint32_t(b), listed));
    });
    for (std::uint32_t b = 0; b < count; ++b) edited_bytes_ += bytes_of(block(b));
  }
  if (now) {
    source->forget();
    return;
  }
  for (std::uint32_t b = 0; b < count; ++b)
    if (!source->is_empty(b) && block(b) == nullptr) blocks_.write(b) = BlockSlot::unmade();
}

void UniformGrid::make_blocks() const {
  using Range = tbb::blocked_range<std::uint32_t>;
  tbb::parallel_for(Range(0, std::uint32_t(blocks_.size()), kBlocksPerTask), [&](const Range& range) {
    for (std::uint32_t b = range.begin(); b < range.end(); ++b) static_cast<void>(block(b));
  });
}

std::size_t UniformGrid::tree_count() const {
  make_blocks();
  std::size_t count = 0;
  for (std::uint32_t b = 0; b < blocks_.size(); ++b)
    if (const GridBlock* held = block(b)) count += held->tree_count();
  return count;
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
  for (const RangeChange& change : changes) {
    if (!change.after.empty()) max_drift_ = std::max(max_drift_, boxes[change.instance_id].drift);
    reference_count_ += change.after.cell_count() - change.before.cell_count();
  }
  const std::vector<ListEdit> edits = list_edits(layout_, changes);
  std::vector<std::size_t> begins;  // of each block's edits
  for (std::size_t i = 0; i < edits.size(); ++i)
    if (i == 0 || edits[i].block != edits[i - 1].block) begins.push_back(i);
  begins.push_back(edits.size());

  std::vector<std::shared_ptr<const GridBlock>> made(begins.size() - 1);
  make_in_parallel(
      made.size(), BlockBuilder(layout_, source_->shape(), boxes, Helpers::kThreads),
      [&](BlockBuilder& builder, std::size_t k) {
        const std::span<const ListEdit> here(edits.data() + begins[k], edits.data() + begins[k + 1]);
        const std::uint32_t index = here[0].block;
        made[k] = blocks_[index].is_made() ? edited(builder, block(index), here)
                                           : builder.make(index, merged(source_->listed(index), here));
      });
  for (std::size_t k = 0; k < made.size(); ++k) {
    const std::uint32_t index = edits[begins[k]].block;
    if (blocks_[index].is_made()) edited_bytes_ -= bytes_of(block(index));
    edited_bytes_ += bytes_of(made[k].get());
    blocks_.write(index) = BlockSlot(std::move(made[k]));
  }
}

}  // namespace gridcast::tlas
