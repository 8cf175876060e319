#include "core/tlas/grid_block.h"

#include <algorithm>
#include <cstring>
#include <new>

#include "core/tlas/cell_reader.h"

namespace gridcast::tlas {
namespace {

constexpr std::size_t kLine = GridBlock::kLineBytes;

std::size_t lines_for(std::size_t bytes) {
  return (bytes + kLine - 1) / kLine;
}

/// Lines of the groups of a cell that lists so many instances.
std::size_t lines_of_cell(std::size_t count) {
  if (count > kMaxFlat) return cell_tree_size(count) * sizeof(BoxGroup<8>) / kLine;
  const std::size_t rest = count % 8;  // up to four of them take half a group
  return (count / 8 * sizeof(BoxGroup<8>) +
          (rest == 0 ? 0 : (rest > 4 ? sizeof(BoxGroup<8>) : sizeof(BoxGroup<4>)))) /
         kLine;
}

CellKind kind_of_cell(std::size_t count) {
  return count > kMaxFlat ? CellKind::kTree : (count > 4 ? CellKind::kEight : CellKind::kFour);
}

template <std::size_t kSlots>
std::byte* write_group(std::byte* at, std::span<const BoxRecord* const> records, const Cell& cell,
                       NextGroup next) {
  auto* group = new (at) BoxGroup<kSlots>;
  set_instances(*group, records, cell);
  group->next = next;
  return at + sizeof *group;
}

/// Calls visit(index) for every bit that is set, ascending.
template <class Visit>
void for_each_bit(std::uint64_t bits, const Visit& visit) {
  for (; bits != 0; bits &= bits - 1) visit(std::uint32_t(std::countr_zero(bits)));
}

}  // namespace

// Counting sort by cell: counts, sums, then every reference to its place, in the order of ids.
void BlockBuilder::file(const CellRange& cells, std::uint64_t wanted, std::span<const std::uint32_t> filed) {
  if (records_.size() < filed.size()) records_.resize(filed.size());
  if (cells_.size() < filed.size()) cells_.resize(filed.size());
  std::fill(std::begin(first_), std::end(first_), 0U);
  // Neighbours in a block are seldom neighbours in the table, so their boxes are asked for early.
  constexpr std::size_t kAhead = 12;
  for (std::size_t k = 0; k < filed.size(); ++k) {
    if (k + kAhead < filed.size()) {
      const auto* ahead = &boxes_[filed[k + kAhead]];
      __builtin_prefetch(ahead);
      __builtin_prefetch(&ahead->drift);
    }
    const std::uint32_t id = filed[k];
    const Bounds3d room = layout_.grown(boxes_[id]);
    BoxRecord& record = records_[k];
    record = {layout_.local_box(room), id, ranges_.empty() ? layout_.range_within(room) : ranges_[id]};
    cells_[k] = layout_.bits_of(record.range.intersection(cells)) & wanted;
    for_each_bit(cells_[k], [&](std::uint32_t local) { ++first_[local + 1]; });
  }
  for (std::size_t c = 1; c < std::size(first_); ++c) first_[c] += first_[c - 1];
  references_.resize(first_[std::size(first_) - 1]);
  // Filling moves the start of each cell to that of the next one, so the starts are shifted back afterwards.
  for (std::size_t k = 0; k < filed.size(); ++k)
    for_each_bit(cells_[k], [&](std::uint32_t local) { references_[first_[local]++] = &records_[k]; });
  std::rotate(std::begin(first_), std::end(first_) - 1, std::end(first_));
  first_[0] = 0;
}

void BlockBuilder::write_cell(std::byte* at, std::span<const BoxRecord* const> records, const Cell& cell) {
  if (records.size() > kMaxFlat) {
    const std::size_t size = cell_tree_size(records.size());
    auto* groups = new (at) BoxGroup<8>[size];
    trees_.build(records, cell, {groups, size});
    return;
  }
  while (records.size() > 4) {
    const std::size_t count = std::min<std::size_t>(records.size(), 8), left = records.size() - count;
    at = write_group<8>(at, records.first(count), cell,
                        left == 0 ? NextGroup::kNone : (left > 4 ? NextGroup::kEight : NextGroup::kFour));
    records = records.subspan(count);
  }
  if (!records.empty()) write_group<4>(at, records, cell, NextGroup::kNone);
}

std::shared_ptr<const GridBlock> BlockBuilder::make(std::uint32_t block,
                                                    std::span<const std::uint32_t> listed) {
  static const GridBlock nothing;
  return patch(block, nothing, DirtyCells(), listed, listed);
}

std::shared_ptr<const GridBlock> BlockBuilder::patch(std::uint32_t block, const GridBlock& old,
                                                     const DirtyCells& dirty,
                                                     std::span<const std::uint32_t> filed,
                                                     std::span<const std::uint32_t> listed) {
  if (listed.empty()) return nullptr;
  const CellRange cells = layout_.cells_of_block(block);
  file(cells, dirty.bits, filed);
  std::uint64_t occupied = old.occupancy() & ~dirty.bits;
  std::size_t group_lines = 0;
  std::uint32_t trees = old.tree_count() - dirty.trees;
  for_each_bit(occupied, [&](std::uint32_t local) { group_lines += old.lines_of(local); });
  for_each_bit(dirty.bits, [&](std::uint32_t local) {
    if (size_of(local) == 0) return;
    occupied |= std::uint64_t(1) << local;
    group_lines += lines_of_cell(size_of(local));
    trees += std::uint32_t(kind_of_cell(size_of(local)) == CellKind::kTree);
  });
  const auto reference_count = old.reference_count() - dirty.references + std::uint32_t(references_.size());
  std::shared_ptr<GridBlock> made =
      GridBlock::allocate(occupied, group_lines, listed, reference_count, trees);
  std::size_t rank = 0, line = made->first_group_line();
  // In the order of local indices, which is that of for_each.
  cells.for_each([&](const Cell& cell) {
    const std::uint32_t local = layout_.local_of(cell);
    if (!made->occupied(local)) return;
    std::byte* const at = made->bytes() + line * kLine;
    const bool is_dirty = ((dirty.bits >> local) & 1U) != 0;
    const std::size_t lines = is_dirty ? lines_of_cell(size_of(local)) : old.lines_of(local);
    made->set_start(rank++, line, is_dirty ? kind_of_cell(size_of(local)) : old.cell(local).kind);
    if (is_dirty) {
      write_cell(at, references(local), cell);
    } else {
      std::memcpy(at, old.cell(local).groups, lines * kLine);
    }
    line += lines;
  });
  return made;
}

DirtyCells::DirtyCells(const GridBlock& block, std::uint64_t dirty) : bits(dirty) {
  const auto note = [&](std::uint32_t id, const Bounds3f& /*box*/, std::uint32_t /*seen*/) {
    ids.push_back(id);
  };
  const CellReader reader(note);
  for_each_bit(block.occupancy() & dirty, [&](std::uint32_t local) {
    const GridBlock::CellStart cell = block.cell(local);
    reader.read(cell);
    trees += std::uint32_t(cell.kind == CellKind::kTree);
  });
  references = std::uint32_t(ids.size());
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

std::shared_ptr<GridBlock> GridBlock::allocate(std::uint64_t occupied, std::size_t group_lines,
                                               std::span<const std::uint32_t> listed,
                                               std::uint32_t references, std::uint32_t trees) {
  const std::size_t starts_bytes = std::size_t(std::popcount(occupied)) * sizeof(std::uint32_t);
  const std::size_t head = lines_for(kStartsOffset + starts_bytes);
  const std::size_t total = head + group_lines + lines_for(listed.size_bytes());
  void* memory = ::operator new(total* kLine, std::align_val_t(kLine));
  auto* block = new (memory) GridBlock;
  std::shared_ptr<GridBlock> owner(block,
                                   [](GridBlock* held) { ::operator delete(held, std::align_val_t(kLine)); });
  block->occupied_ = occupied;
  block->listed_line_ = std::uint32_t(head + group_lines);
  block->listed_count_ = std::uint32_t(listed.size());
  block->line_count_ = std::uint32_t(total);
  block->reference_count_ = references;
  block->tree_count_ = trees;
  std::memcpy(block->bytes() + std::size_t(block->listed_line_) * kLine, listed.data(), listed.size_bytes());
  return owner;
}

void GridBlock::set_start(std::size_t rank, std::size_t line, CellKind kind) {
  const std::uint32_t start = std::uint32_t(line << 2) | std::uint32_t(kind);
  std::memcpy(bytes() + kStartsOffset + rank * sizeof start, &start, sizeof start);
}

std::size_t GridBlock::lines_of(std::uint32_t local) const {
  const std::uint64_t later = occupied_ & (~std::uint64_t(1) << local);
  const std::byte* const end = later == 0 ? bytes() + std::size_t(listed_line_) * kLineBytes
                                          : cell(std::uint32_t(std::countr_zero(later))).groups;
  return std::size_t(end - cell(local).groups) / kLineBytes;
}

std::size_t GridBlock::first_group_line() const {
  return lines_for(kStartsOffset + std::size_t(std::popcount(occupied_)) * sizeof(std::uint32_t));
}

}  // namespace gridcast::tlas
