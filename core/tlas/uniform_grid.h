#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "core/error.h"
#include "core/math/chunked_vector.h"
#include "core/tlas/block_source.h"
#include "core/tlas/grid_block.h"
#include "core/tlas/grid_layout.h"
#include "core/tlas/group_visitor.h"
#include "core/tlas/instance_visitor.h"

namespace gridcast::tlas {

/// An instance whose box or cells change.
struct RangeChange {
  std::uint32_t instance_id;
  CellRange before, after;
};

/// When the blocks of a grid are made: all as it is built, or each when somebody first looks at it.
enum class MakeBlocks : std::uint8_t { kNow, kWhenAsked };

/// The cells of a uniform grid, in blocks that copies share. A block without instances is null. What it holds
/// is a function of the layout and the boxes alone, whether it was updated or built anew.
class UniformGrid {
 public:
  UniformGrid() = default;
  /// Files every box that the layout has cells for. Parallel, and the same whatever the number of threads.
  UniformGrid(const GridLayout& layout, const BoxTable& boxes, MakeBlocks when = MakeBlocks::kNow);

  /// Files instances anew, each at most once, `boxes` being those afterwards; makes the blocks anew that they
  /// are in before or after, and no others.
  void apply(std::span<const RangeChange> changes, const BoxTable& boxes);

  /// Visits, once each, all instances that can hold a hit of a ray that starts within the layout's reach;
  /// returns the last far. Follows the cells along the ray.
  double walk(const WorldRay& ray, double far, const InstanceVisitor& visitor) const;
  /// The same for the rays worlds[i] of the bits of `rays`, up to far[i] each.
  void walk_group(const WorldRay* worlds, std::uint32_t rays, double* far, const GroupVisitor& visitor) const;
  /// The same for a ray from anywhere: looks at all blocks that the ray may pass with the room that its
  /// distance asks for.
  double search(const WorldRay& ray, double far, const BoxTable& boxes, const InstanceVisitor& visitor) const;

  [[nodiscard]] const GridLayout& layout() const { return layout_; }
  /// Null when nothing is in the block. Makes it if need be; any number of threads may ask.
  [[nodiscard]] const GridBlock* block(std::uint32_t index) const {
    return blocks_[index].get(index, *source_);
  }
  /// Makes all blocks that are not made yet, in parallel.
  void make_blocks() const;

  struct Stats {
    std::size_t occupied_cells = 0;
    std::size_t tree_cells = 0;
    std::size_t max_references_in_cell = 0;
    double cells_cost = 0.0;  ///< what the cells cost a ray that meets all, by the cost model
  };
  [[nodiscard]] Stats stats() const;                            ///< looks at every cell
  [[nodiscard]] std::size_t tree_count() const;                 ///< cells with a tree; looks at every block
  [[nodiscard]] float max_drift() const { return max_drift_; }  ///< of any box filed since the build
  [[nodiscard]] const FilingSummary& at_build() const { return source_->summary(); }
  [[nodiscard]] std::uint64_t reference_count() const { return reference_count_; }
  /// Of the blocks that are made, as good as exactly.
  [[nodiscard]] std::size_t block_bytes() const {
    return std::size_t(std::max<std::int64_t>(0, edited_bytes_ + source_->made_bytes()));
  }
  [[nodiscard]] std::size_t memory_bytes() const {
    return blocks_.memory_bytes() + source_->memory_bytes() + block_bytes();
  }
  /// Every instance is in exactly the cells of its range, in a box that holds its own, and known to the
  /// neighbours that list it.
  [[nodiscard]] Status validate(const BoxTable& boxes) const;

 private:
  [[nodiscard]] Status validate_block(std::uint32_t index, const BoxTable& boxes, std::uint64_t& found) const;
  GridLayout layout_;
  std::shared_ptr<const BlockSource> source_;
  ChunkedVector<BlockSlot, 64> blocks_;
  std::int64_t edited_bytes_ = 0;  ///< of blocks that were made in advance, less those replaced
  std::uint64_t reference_count_ = 0;
  float max_drift_ = 0.F;
};

}  // namespace gridcast::tlas
