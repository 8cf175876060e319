#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/tlas/box_group.h"
#include "core/tlas/cell_tree.h"

namespace gridcast::tlas {

/// How the boxes of a cell are kept.
enum class CellKind : std::uint8_t { kFour, kEight, kTree };

/// Up to 64 cells with what they list, in one piece of memory of whole cache lines: a word of occupancy,
/// where each occupied cell starts, the groups of boxes, and the ids of all instances that reach into the
/// block, ascending. Immutable; grids share it.
class alignas(64) GridBlock {
 public:
  struct CellStart {
    const std::byte* groups;
    CellKind kind;
  };

  [[nodiscard]] bool occupied(std::uint32_t local) const { return ((occupied_ >> local) & 1U) != 0; }
  [[nodiscard]] std::uint64_t occupancy() const { return occupied_; }
  [[nodiscard]] CellStart cell(std::uint32_t local) const {
    const int rank = std::popcount(occupied_ & ((std::uint64_t(1) << local) - 1));
    std::uint32_t start = 0;
    __builtin_memcpy(&start, bytes() + kStartsOffset + std::size_t(rank) * sizeof start, sizeof start);
    return {bytes() + std::size_t(start >> 2) * kLineBytes, CellKind(start & 3U)};
  }
  [[nodiscard]] std::span<const std::uint32_t> listed() const {
    const void* ids = bytes() + std::size_t(listed_line_) * kLineBytes;
    return {static_cast<const std::uint32_t*>(ids), listed_count_};
  }
  [[nodiscard]] std::size_t memory_bytes() const { return std::size_t(line_count_) * kLineBytes; }
  [[nodiscard]] std::uint32_t reference_count() const { return reference_count_; }
  [[nodiscard]] std::uint32_t tree_count() const { return tree_count_; }  ///< cells with a tree

  static constexpr std::size_t kLineBytes = 64;

 private:
  friend class BlockBuilder;
  static constexpr std::size_t kStartsOffset = 28;
  GridBlock() = default;
  /// With room for the groups, which the builder writes from first_group_line() on.
  [[nodiscard]] static std::shared_ptr<GridBlock> allocate(std::uint64_t occupied, std::size_t group_lines,
                                                           std::span<const std::uint32_t> listed,
                                                           std::uint32_t references, std::uint32_t trees);
  [[nodiscard]] std::size_t first_group_line() const;
  [[nodiscard]] std::size_t lines_of(std::uint32_t local) const;      ///< of the groups of an occupied cell
  void set_start(std::size_t rank, std::size_t line, CellKind kind);  ///< of the occupied cell of that rank
  [[nodiscard]] const std::byte* bytes() const {
    const void* self = this;
    return static_cast<const std::byte*>(self);
  }
  [[nodiscard]] std::byte* bytes() {
    void* self = this;
    return static_cast<std::byte*>(self);
  }

  std::uint64_t occupied_ = 0;
  std::uint32_t listed_line_ = 0, listed_count_ = 0;
  std::uint32_t line_count_ = 0, reference_count_ = 0;
  std::uint32_t tree_count_ = 0;
};

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
  /// `ranges` are those of the boxes where they are known, by id, or none.
  BlockBuilder(const GridLayout& layout, const BoxTable& boxes, std::span<const CellRange> ranges = {})
      : layout_(layout), boxes_(boxes), ranges_(ranges) {}
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
  /// Finds the references of the cells `wanted` among `cells`.
  void file(const CellRange& cells, std::uint64_t wanted, std::span<const std::uint32_t> filed);
  [[nodiscard]] std::uint32_t size_of(std::uint32_t local) const { return first_[local + 1] - first_[local]; }
  [[nodiscard]] std::span<const BoxRecord* const> references(std::size_t local) const {
    return {references_.data() + first_[local], references_.data() + first_[local + 1]};
  }
  void write_cell(std::byte* at, std::span<const BoxRecord* const> records, const Cell& cell);

  const GridLayout& layout_;
  const BoxTable& boxes_;
  std::span<const CellRange> ranges_;
  std::vector<BoxRecord> records_;            ///< of the instances listed
  std::vector<std::uint64_t> cells_;          ///< of each record, a bit each
  std::vector<const BoxRecord*> references_;  ///< by cell
  std::uint32_t first_[65] = {};              ///< of each cell in references_
  CellTreeBuilder trees_;
};

}  // namespace gridcast::tlas
