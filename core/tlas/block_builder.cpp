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

/// Calls visit(index) for every bit that is set, ascending.
template <class Visit>
void for_each_bit(std::uint64_t bits, const Visit& visit) {
  for (; bits != 0; bits &= bits - 1) visit(std::uint32_t(std::countr_zero(bits)));
}

/// The cell with local_of() `local` of the block whose first cell is `first`.
Cell cell_in_block(const GridLayout& layout, const Cell& first, std::uint32_t local) {
  Cell cell = first;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cell[axis] = std::uint16_t(cell[axis] + (local & ((1U << layout.shift[axis]) - 1U)));
    local >>= layout.shift[axis];
  }
  return cell;
}

}  // namespace

BlockBuilder::BlockBuilder(const GridLayout& layout, const BlockShape& shape, const BoxTable& boxes,
                           Helpers helpers)
    : layout_(layout), shape_(shape), boxes_(boxes), helpers_(helpers), filing_(layout) {}

void BlockBuilder::write_crowded_cells() {
  references_.clear();
  std::vector<std::size_t> begins;
  for (const CrowdedCell& crowded : crowded_) {
    begins.push_back(references_.size());
    lists_.append(crowded.local, references_);
  }
  begins.push_back(references_.size());
  const auto write = [&](std::size_t k, CellTreeBuilder& trees) {
    const std::span references(references_.data() + begins[k], references_.data() + begins[k + 1]);
    const std::size_t size = cell_tree_size(references.size());
    auto* groups = new (crowded_[k].at) BoxGroup<8>[size];
    trees.build(references, crowded_[k].cell, {groups, size});
  };
  if (helpers_ == Helpers::kNone || references_.size() < kManyReferences) {
    for (std::size_t k = 0; k < crowded_.size(); ++k) write(k, trees_);
  } else {
    tbb::parallel_for(std::size_t(0), crowded_.size(), [&](std::size_t k) {
      CellTreeBuilder trees;
      write(k, trees);
    });
  }
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
  const Cell first = layout_.cells_of_block(block).lower;
  records_.resize(filed.size() + 1);
  filing_.make_records(boxes_, filed, records_.data());
  records_.back() = kNoRecord;
  lists_.find(shape_, first, records_, dirty.bits);
  std::uint64_t occupied = old.occupancy() & ~dirty.bits;
  std::size_t group_lines = 0;
  std::uint32_t trees = old.tree_count() - dirty.trees;
  auto reference_count = old.reference_count() - dirty.references;
  for_each_bit(occupied, [&](std::uint32_t local) { group_lines += old.lines_of(local); });
  for_each_bit(dirty.bits, [&](std::uint32_t local) {
    const std::uint32_t size = lists_.size_of(local);
    if (size == 0) return;
    occupied |= std::uint64_t(1) << local;
    reference_count += size;
    group_lines += lines_of_cell(size);
    trees += std::uint32_t(kind_of_cell(size) == CellKind::kTree);
  });
  std::shared_ptr<GridBlock> made =
      GridBlock::allocate(occupied, group_lines, listed, reference_count, trees);
  std::size_t rank = 0, line = made->first_group_line();
  flat_.clear();
  crowded_.clear();
  for_each_bit(occupied, [&](std::uint32_t local) {
    std::byte* const at = made->bytes() + line * kLine;
    if (((dirty.bits >> local) & 1U) == 0) {
      const std::size_t lines = old.lines_of(local);
      made->set_start(rank++, line, old.cell(local).kind);
      std::memcpy(at, old.cell(local).groups, lines * kLine);
      line += lines;
      return;
    }
    const std::uint32_t size = lists_.size_of(local);
    const CellKind kind = kind_of_cell(size);
    made->set_start(rank++, line, kind);
    line += lines_of_cell(size);
    if (kind == CellKind::kTree) {
      crowded_.push_back({at, local, cell_in_block(layout_, first, local)});
    } else {
      flat_.push_back({CellNumbers(cell_in_block(layout_, first, local)), at, local});
    }
  });
  lists_.write(flat_);
  if (!crowded_.empty()) write_crowded_cells();
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
