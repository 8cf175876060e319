#include "core/tlas/grid_block.h"

#include <algorithm>
#include <cstring>
#include <new>

namespace gridcast::tlas {
namespace {

constexpr std::size_t kLine = GridBlock::kLineBytes;

std::size_t lines_for(std::size_t bytes) {
  return (bytes + kLine - 1) / kLine;
}

}  // namespace

// Counting sort by cell: counts, sums, then every reference to its place, in the order of ids.
void BlockBuilder::file(const CellRange& cells, std::span<const std::uint32_t> listed) {
  records_.clear();
  std::fill(std::begin(first_), std::end(first_), 0U);
  // Neighbours in a block are seldom neighbours in the table, so their boxes are asked for early.
  constexpr std::size_t kAhead = 12;
  for (std::size_t k = 0; k < listed.size(); ++k) {
    if (k + kAhead < listed.size()) {
      const auto* ahead = &boxes_[listed[k + kAhead]];
      __builtin_prefetch(ahead);
      __builtin_prefetch(&ahead->drift);
    }
    const std::uint32_t id = listed[k];
    const InstanceBox& box = boxes_[id];
    const Bounds3d room = layout_.grown(box);
    const BoxRecord& record =
        records_.emplace_back(BoxRecord{layout_.local_box(room), id, layout_.range_within(room)});
    record.range.intersection(cells).for_each([&](const Cell& c) { ++first_[layout_.local_of(c) + 1]; });
  }
  for (std::size_t c = 1; c < std::size(first_); ++c) first_[c] += first_[c - 1];
  references_.resize(first_[std::size(first_) - 1]);
  // Filling moves the start of each cell to that of the next one, so the starts are shifted back afterwards.
  for (const BoxRecord& record : records_) {
    record.range.intersection(cells).for_each(
        [&](const Cell& c) { references_[first_[layout_.local_of(c)]++] = &record; });
  }
  std::rotate(std::begin(first_), std::end(first_) - 1, std::end(first_));
  first_[0] = 0;
}

template <std::size_t kSlots>
void BlockBuilder::append_group(std::span<const BoxRecord* const> records, const Cell& cell, NextGroup next) {
  const std::size_t at = lines_.size();
  lines_.resize(at + sizeof(BoxGroup<kSlots>) / kLine);
  auto* group = new (&lines_[at]) BoxGroup<kSlots>;
  group->clear();
  group->next = next;
  for (std::size_t slot = 0; slot < records.size(); ++slot) set_instance(*group, slot, *records[slot], cell);
}

void BlockBuilder::append_cell(std::span<const BoxRecord*> records, const Cell& cell) {
  const auto start = std::uint32_t(lines_.size() << 2);
  if (records.size() > kMaxFlat) {
    tree_.clear();
    append_cell_tree(records, cell, tree_);
    const std::size_t at = lines_.size();
    lines_.resize(at + tree_.size() * sizeof(tree_[0]) / kLine);
    std::memcpy(&lines_[at], tree_.data(), tree_.size() * sizeof(tree_[0]));
    starts_.push_back(start | std::uint32_t(CellKind::kTree));
    return;
  }
  starts_.push_back(start | std::uint32_t(records.size() > 4 ? CellKind::kEight : CellKind::kFour));
  while (records.size() > 4) {
    const std::size_t count = std::min<std::size_t>(records.size(), 8), left = records.size() - count;
    append_group<8>(records.first(count), cell,
                    left == 0 ? NextGroup::kNone : (left > 4 ? NextGroup::kEight : NextGroup::kFour));
    records = records.subspan(count);
  }
  if (!records.empty()) append_group<4>(records, cell, NextGroup::kNone);
}

std::shared_ptr<const GridBlock> BlockBuilder::assemble(std::uint64_t occupied,
                                                        std::span<const std::uint32_t> listed) const {
  const std::size_t head = lines_for(GridBlock::kStartsOffset + starts_.size() * sizeof(starts_[0]));
  const std::size_t total = head + lines_.size() + lines_for(listed.size_bytes());
  void* memory = ::operator new(total* kLine, std::align_val_t(kLine));
  auto* block = new (memory) GridBlock;
  std::shared_ptr<const GridBlock> owner(block, [](const GridBlock* held) {
    ::operator delete(const_cast<GridBlock*>(held), std::align_val_t(kLine));
  });
  block->occupied_ = occupied;
  block->listed_line_ = std::uint32_t(head + lines_.size());
  block->listed_count_ = std::uint32_t(listed.size());
  block->line_count_ = std::uint32_t(total);
  block->reference_count_ = std::uint32_t(references_.size());
  auto* bytes = static_cast<std::byte*>(memory);
  std::byte* start = bytes + GridBlock::kStartsOffset;
  for (const std::uint32_t relative : starts_) {
    block->tree_count_ += std::uint32_t(CellKind(relative & 3U) == CellKind::kTree);
    const auto moved = std::uint32_t(relative + (head << 2));
    std::memcpy(start, &moved, sizeof moved);
    start += sizeof moved;
  }
  std::memcpy(bytes + head * kLine, lines_.data(), lines_.size() * kLine);
  std::memcpy(bytes + std::size_t(block->listed_line_) * kLine, listed.data(), listed.size_bytes());
  return owner;
}

std::shared_ptr<const GridBlock> BlockBuilder::make(std::uint32_t block,
                                                    std::span<const std::uint32_t> listed) {
  if (listed.empty()) return nullptr;
  const CellRange cells = layout_.cells_of_block(block);
  file(cells, listed);
  starts_.clear();
  lines_.clear();
  std::uint64_t occupied = 0;
  // In the order of local indices, which is that of for_each.
  cells.for_each([&](const Cell& cell) {
    const std::uint32_t local = layout_.local_of(cell);
    if (first_[local] == first_[local + 1]) return;
    occupied |= std::uint64_t(1) << local;
    append_cell({references_.data() + first_[local], references_.data() + first_[local + 1]}, cell);
  });
  return assemble(occupied, listed);
}

}  // namespace gridcast::tlas
