#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "core/tlas/block_lists.h"
#include "core/tlas/cell_lists.h"
#include "core/tlas/grid_block.h"

namespace gridcast::tlas {

class BlockSource;

/// A block of a grid, which may have to be made yet. A copy shares what is made.
class BlockSlot {
 public:
  /// Null for a block without instances.
  explicit BlockSlot(std::shared_ptr<const GridBlock> block = nullptr)
      : owner_(std::move(block)), block_(owner_.get()) {}
  BlockSlot(const BlockSlot& other) { *this = other; }
  BlockSlot& operator=(const BlockSlot& other) {
    const GridBlock* const block = other.block_.load(std::memory_order_acquire);
    if (this == &other) return *this;
    if (block != &kUnmade) owner_ = other.owner_;
    block_.store(block, std::memory_order_release);
    return *this;
  }
  ~BlockSlot() = default;
  /// One that is made when somebody asks for it.
  [[nodiscard]] static BlockSlot unmade() {
    BlockSlot slot;
    slot.block_.store(&kUnmade, std::memory_order_relaxed);
    return slot;
  }

  [[nodiscard]] bool is_made() const { return block_.load(std::memory_order_acquire) != &kUnmade; }
  /// The block of that index in `source`. Any number of threads may ask.
  [[nodiscard]] const GridBlock* get(std::uint32_t index, const BlockSource& source) const {
    const GridBlock* const block = block_.load(std::memory_order_acquire);
    return block == &kUnmade ? make(index, source) : block;
  }

 private:
  friend class BlockSource;
  static const GridBlock kUnmade;  ///< its address stands for a block that is not made
  [[nodiscard]] const GridBlock* make(std::uint32_t index, const BlockSource& source) const;

  mutable std::shared_ptr<const GridBlock> owner_;  ///< written once, before block_
  mutable std::atomic<const GridBlock*> block_;
};

/// What the blocks of a grid are made of, as it was when the grid was built.
class BlockSource {
 public:
  BlockSource(const GridLayout& layout, const BoxTable& boxes);
  BlockSource(const BlockSource&) = delete;
  BlockSource& operator=(const BlockSource&) = delete;
  ~BlockSource() = default;

  /// Not after forget().
  [[nodiscard]] std::vector<std::uint32_t> listed(std::size_t block) const { return (*lists_)[block]; }
  [[nodiscard]] bool is_empty(std::size_t block) const { return lists_->empty(block); }
  [[nodiscard]] const BoxTable& boxes() const { return *boxes_; }
  /// Lets go of all that blocks are made of.
  void forget();

  [[nodiscard]] const GridLayout& layout() const { return layout_; }
  [[nodiscard]] const BlockShape& shape() const { return shape_; }
  [[nodiscard]] const FilingSummary& summary() const { return summary_; }
  [[nodiscard]] std::int64_t made_bytes() const { return made_bytes_; }  ///< of blocks that were asked for
  [[nodiscard]] std::size_t memory_bytes() const { return lists_ ? lists_->memory_bytes() : 0; }

 private:
  friend class BlockSlot;

  GridLayout layout_;
  BlockShape shape_;
  std::optional<BoxTable> boxes_;
  std::optional<BlockLists> lists_;
  FilingSummary summary_;
  mutable std::array<std::mutex, 32> making_;  ///< of block i: number i modulo 32
  mutable std::atomic<std::int64_t> made_bytes_ = 0;
};

}  // namespace gridcast::tlas
