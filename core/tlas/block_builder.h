#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/tlas/box_filing.h"
#include "core/tlas/cell_lists.h"
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

/// Whether other threads may help with the trees of a block.
enum class Helpers : std::uint8_t { kNone, kThreads };

/// Makes blocks; one per thread, so that its scratch memory is used again.
class BlockBuilder {
 public:
  /// What is given outlives the builder.
  BlockBuilder(const GridLayout& layout, const BlockShape& shape, const BoxTable& boxes, Helpers helpers);
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
  /// A cell that is to have a tree, and where.
  struct CrowdedCell {
    std::byte* at;
    std::uint32_t local;
    Cell cell;
  };
  void write_crowded_cells();

  const GridLayout& layout_;
  const BlockShape& shape_;
  const BoxTable& boxes_;
  Helpers helpers_;
  BoxFiling filing_;
  std::vector<BoxRecord> records_;  ///< of the block, and kNoRecord
  CellLists lists_;
  std::vector<FlatCell> flat_;
  std::vector<CrowdedCell> crowded_;
  std::vector<const BoxRecord*> references_;  ///< of crowded cells, one after the other
  CellTreeBuilder trees_;
};

}  // namespace gridcast::tlas
