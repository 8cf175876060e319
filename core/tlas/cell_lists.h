#pragma once
// The inner loops of building a block: which instances its cells list, and the groups of those that have few.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/tlas/box_record.h"

namespace gridcast::tlas {

/// The cells of any block of a grid as bits, by their coordinates in the block.
struct BlockShape {
  static constexpr std::size_t kMostCells = std::size_t(1) << kBlockBits;

  explicit BlockShape(const GridLayout& layout);

  using Table = std::array<std::array<std::uint64_t, kMostCells>, 3>;
  /// [axis][k]: the cells whose coordinate along the axis is at least, or at most, k.
  Table from{}, up_to{};
  Cell last{};  ///< largest coordinates
};

/// A cell beside the neighbours of BoxRecord: nothing, nothing, x, y, z, x, y, z. See GroupWriter.
struct alignas(16) CellNumbers {
  CellNumbers() = default;
  explicit CellNumbers(const Cell& cell)
      : lanes{0, 0, cell[0], cell[1], cell[2], cell[0], cell[1], cell[2]} {}
  std::uint16_t lanes[8] = {};
};

/// A cell with few instances, and where its groups are to be.
struct FlatCell {
  CellNumbers cell;
  std::byte* at;
  std::uint32_t local;
};

/// Writes a group that none comes after, of eight records of a cell; kNoRecord where a slot is not used.
void write_group(const BoxRecord* const* records, const CellNumbers& cell, BoxGroup<8>& group);

/// Which of some records each cell of a block lists. One per thread, so that its memory is used again.
class CellLists {
 public:
  /// Of the block whose first cell is `first`, the cells `wanted`. After the last of the records comes
  /// kNoRecord.
  void find(const BlockShape& shape, const Cell& first, std::span<const BoxRecord> records,
            std::uint64_t wanted);
  [[nodiscard]] std::uint32_t size_of(std::uint32_t local) const { return sizes_[local]; }
  /// In order, of the records that find() was given last.
  void append(std::uint32_t local, std::vector<const BoxRecord*>& to) const;
  /// Writes the groups of cells that list kMaxFlat records at most, and one at least.
  void write(std::span<const FlatCell> cells) const;

 private:
  std::span<const BoxRecord> records_;
  /// Bit k of word [64 w + local]: the cell lists records_[64 w + k].
  std::vector<std::uint64_t> words_;
  std::array<std::uint32_t, BlockShape::kMostCells> sizes_{};
};

}  // namespace gridcast::tlas
