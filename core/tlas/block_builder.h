#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/tlas/cell_tree.h"
#include "core/tlas/grid_block.h"

namespace gridcast::tlas {

/// Cells of a block that are to be made anew, and what they hold until then.
struct DirtyCells {
  std::uint64_t bits = ~std::uint64_t(0);
  std::vector<std::uint32_t> ids;  ///< ascending
  std::uint32_t references = 0, trees = 0;

  /// All cells of a block that holds nothing.
  DirtyCells() = default;
  DirtyCells(const GridBlock& block, std::uint64_t dirty);
};

/// Makes blocks; one per thread, so that its scratch memory is used again.
class BlockBuilder {
 public:
  /// `records` are those of the boxes where they are known, by id, or none.
  BlockBuilder(const GridLayout& layout, const BoxTable& boxes, std::span<const BoxRecord> records = {});
  /// The block in which exactly the instances `listed` (ascending) are filed; null when there are none. A
  /// function of the layout and the boxes alone.
  [[nodiscard]] std::shared_ptr<const GridBlock> make(std::uint32_t block,
                                                      std::span<const std::uint32_t> listed);
  /// The same from the block as it was, where nothing has changed but in the cells `dirty`: the others are
  /// copied. `filed` (ascending) has all instances of the dirty cells as they are to be.
  [[nodiscard]] std::shared_ptr<const GridBlock> patch(std::uint32_t block, const GridBlock& old,
                                                       const DirtyCells& dirty,
                                                       std::span<const std::uint32_t> filed,
                                                       std::span<const std::uint32_t> listed);

 private:
  /// Makes the records of these instances.
  void make_records(std::span<const std::uint32_t> filed);
  void find_cells(const BoxRecord& record, const CellRange& cells, std::uint64_t wanted);
  /// Finds the references of the cells `wanted` among `cells`.
  void file(const CellRange& cells, std::uint64_t wanted, std::span<const std::uint32_t> filed);
  [[nodiscard]] std::uint32_t size_of(std::uint32_t local) const { return first_[local + 1] - first_[local]; }
  [[nodiscard]] std::span<const BoxRecord* const> references(std::size_t local) const {
    return {references_.data() + first_[local], references_.data() + first_[local + 1]};
  }
  /// A cell that is to have a tree, and where.
  struct CrowdedCell {
    std::byte* at;
    std::span<const BoxRecord* const> records;
    Cell cell;
  };
  /// Of a cell without a tree.
  static void write_cell(std::byte* at, std::span<const BoxRecord* const> records, const Cell& cell);
  void write_crowded_cells();

  static constexpr std::size_t kMostCells = 64;

  const GridLayout& layout_;
  const BoxTable& boxes_;
  std::span<const BoxRecord> records_;
  std::vector<BoxRecord> own_records_;  ///< where there are no others
  /// References as they are found, with the cell of each; those from found_count_ on mean nothing.
  std::vector<const BoxRecord*> found_;
  std::vector<std::uint8_t> locals_;
  std::size_t found_count_ = 0;
  std::vector<const BoxRecord*> references_;  ///< by cell
  std::uint32_t first_[65] = {};              ///< of each cell in references_
  /// Of a box of one or two cells along each axis (bit a: two along axis a): its cells, from its first one.
  std::uint8_t corners_[8][8] = {};
  std::uint8_t corner_count_[8] = {};
  std::vector<CrowdedCell> crowded_;
  CellTreeBuilder trees_;
};

}  // namespace gridcast::tlas
