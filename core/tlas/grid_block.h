#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "core/math/line_memory.h"
#include "core/tlas/box_group.h"

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

  static constexpr std::size_t kLineBytes = kCacheLineBytes;

 private:
  friend class BlockBuilder;
  friend class BlockSlot;
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

}  // namespace gridcast::tlas
