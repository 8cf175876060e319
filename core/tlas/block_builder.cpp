#include "core/tlas/block_builder.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include <tbb/parallel_for.h>

#include "core/tlas/cell_reader.h"

namespace gridcast::tlas {
namespace {

constexpr std::size_t kLine = GridBlock::kLineBytes;
/// From so many references in crowded cells on, the trees of a block are shared among threads: a crowd may be
/// in a single block.
constexpr std::size_t kManyReferences = 2048;

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

void BlockBuilder::make_records(std::span<const std::uint32_t> filed) {
  if (own_records_.size() < filed.size()) own_records_.resize(filed.size());
  constexpr std::size_t kAhead = 12;
  for (std::size_t k = 0; k < filed.size(); ++k) {
    if (k + kAhead < filed.size()) {
      const InstanceBox& ahead = boxes_[filed[k + kAhead]];
      __builtin_prefetch(&ahead);
      __builtin_prefetch(&ahead.drift);
    }
    const Bounds3d room = layout_.grown(boxes_[filed[k]]);
    own_records_[k] = {layout_.local_box(room), filed[k], layout_.range_within(room)};
  }
}

BlockBuilder::BlockBuilder(const GridLayout& layout, const BoxTable& boxes,
                           std::span<const BoxRecord> records)
    : layout_(layout), boxes_(boxes), records_(records) {
  for (std::uint32_t extent = 0; extent < 8; ++extent) {
    std::size_t size = 0;
    for (std::uint32_t corner = 0; corner < 8; ++corner)
      if ((corner & ~extent) == 0)
        corners_[extent][size++] = std::uint8_t(layout.local_of(corner & 1U, corner >> 1 & 1U, corner >> 2));
    corner_count_[extent] = std::uint8_t(size);
  }
}

/// Appends the cells of a box to what is found. Most boxes lie in one or two cells along each axis: these are
/// written as eight at once, of which those that are too many are written over, since a loop over the right
/// number ends in a branch that is hardly ever foreseen.
void BlockBuilder::find_cells(const BoxRecord& record, const CellRange& cells, std::uint64_t wanted) {
  if (found_.size() < found_count_ + kMostCells) {
    found_.resize(2 * found_.size() + kMostCells);
    locals_.resize(found_.size());
  }
  const CellRange part = record.range.intersection(cells);
  std::uint32_t extent = 0;
  bool small = wanted == ~std::uint64_t(0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto more = std::uint32_t(part.upper[axis] - part.lower[axis]);
    small = small && more <= 1;
    extent |= more << axis;
  }
  const BoxRecord** const found = found_.data() + found_count_;
  std::uint8_t* const locals = locals_.data() + found_count_;
  if (small) {
    const auto first = std::uint8_t(layout_.local_of(part.lower));
    for (std::size_t k = 0; k < 8; ++k) locals[k] = std::uint8_t(first + corners_[extent][k]);
    for (std::size_t k = 0; k < 8; ++k) found[k] = &record;
    found_count_ += corner_count_[extent];
    return;
  }
  std::size_t size = 0;
  for_each_bit(layout_.bits_of(part) & wanted, [&](std::uint32_t local) {
    locals[size] = std::uint8_t(local);
    found[size++] = &record;
  });
  found_count_ += size;
}

// Counting sort by cell: counts, sums, then every reference to its place, in the order of ids.
void BlockBuilder::file(const CellRange& cells, std::uint64_t wanted, std::span<const std::uint32_t> filed) {
  if (records_.empty()) make_records(filed);
  const auto record_of = [&](std::size_t k) -> const BoxRecord& {
    return records_.empty() ? own_records_[k] : records_[filed[k]];
  };
  // Neighbours in a block are seldom neighbours in the table, so their records are asked for early.
  constexpr std::size_t kAhead = 12;
  found_count_ = 0;
  for (std::size_t k = 0; k < filed.size(); ++k) {
    if (k + kAhead < filed.size()) {
      const BoxRecord& ahead = record_of(k + kAhead);
      __builtin_prefetch(&ahead);
      __builtin_prefetch(&ahead.range);
    }
    find_cells(record_of(k), cells, wanted);
  }
  std::fill(std::begin(first_), std::end(first_), 0U);
  for (std::size_t i = 0; i < found_count_; ++i) ++first_[locals_[i] + 1U];
  for (std::size_t c = 1; c < std::size(first_); ++c) first_[c] += first_[c - 1];
  references_.resize(found_count_);
  // Filling moves the start of each cell to that of the next one, so the starts are shifted back afterwards.
  for (std::size_t i = 0; i < found_count_; ++i) references_[first_[locals_[i]]++] = found_[i];
  std::rotate(std::begin(first_), std::end(first_) - 1, std::end(first_));
  first_[0] = 0;
}

void BlockBuilder::write_cell(std::byte* at, std::span<const BoxRecord* const> records, const Cell& cell) {
  while (records.size() > 4) {
    const std::size_t count = std::min<std::size_t>(records.size(), 8), left = records.size() - count;
    at = write_group<8>(at, records.first(count), cell,
                        left == 0 ? NextGroup::kNone : (left > 4 ? NextGroup::kEight : NextGroup::kFour));
    records = records.subspan(count);
  }
  if (!records.empty()) write_group<4>(at, records, cell, NextGroup::kNone);
}

void BlockBuilder::write_crowded_cells() {
  const auto write = [](const CrowdedCell& crowded, CellTreeBuilder& trees) {
    const std::size_t size = cell_tree_size(crowded.records.size());
    auto* groups = new (crowded.at) BoxGroup<8>[size];
    trees.build(crowded.records, crowded.cell, {groups, size});
  };
  std::size_t count = 0;
  for (const CrowdedCell& crowded : crowded_) count += crowded.records.size();
  if (count < kManyReferences) {
    for (const CrowdedCell& crowded : crowded_) write(crowded, trees_);
  } else {
    tbb::parallel_for(std::size_t(0), crowded_.size(), [&](std::size_t k) {
      CellTreeBuilder trees;
      write(crowded_[k], trees);
    });
  }
  crowded_.clear();
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
    if (is_dirty && kind_of_cell(size_of(local)) == CellKind::kTree) {
      crowded_.push_back({at, references(local), cell});
    } else if (is_dirty) {
      write_cell(at, references(local), cell);
    } else {
      std::memcpy(at, old.cell(local).groups, lines * kLine);
    }
    line += lines;
  });
  write_crowded_cells();
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

}  // namespace gridcast::tlas
