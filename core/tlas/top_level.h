#pragma once
// The top level: leads a world ray to the instances it can touch.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/math/bounds.h"
#include "core/math/chunked_vector.h"
#include "core/math/ray.h"
#include "core/tlas/grid_walk.h"
#include "core/tlas/instance_box.h"
#include "core/tlas/uniform_grid.h"
#include "core/tlas/world_ray.h"

namespace gridcast::tlas {

/// kNone: no structure, every instance box is tested (a scene of one or a few instances needs no grid).
enum class TopLevelKind : std::uint8_t { kNone, kUniformGrid };
[[nodiscard]] std::string_view to_string(TopLevelKind kind);  ///< none, uniform_grid

struct TopLevelStats {
  TopLevelKind kind = TopLevelKind::kNone;
  std::string reason;  ///< why this kind and resolution, as a sentence
  std::uint32_t cells[3] = {0, 0, 0};
  Bounds3d bounds;
  std::size_t instance_count = 0;  ///< with a box, so reachable
  std::size_t cell_count = 0;
  std::size_t occupied_cells = 0;
  std::size_t reference_count = 0;  ///< instances counted once per cell that lists them
  std::size_t max_references_in_cell = 0;
  std::size_t always_tested = 0;  ///< instances in no cell, tested for every ray
  std::size_t memory_bytes = 0;
  double build_ms = 0.0;
};

/// kAuto follows the cost model; kNone never makes a grid (the reference that the grid is compared with).
enum class TopLevelChoice : std::uint8_t { kAuto, kNone };

/// A top level over the world boxes of instances. A value: copies share all memory, and a copy that is
/// updated copies only what changes. It knows no instance but by its id and its box.
///
/// No hit is lost: core/scene/hit_box.cpp shows that a hit lies in the instance's box grown by its drift,
/// GridLayout files the box with that room, GridWalk shows that the walk visits a cell of it. The answers are
/// thus the same whatever the structure, and whether it was updated or built anew.
class TopLevel {
 public:
  TopLevel() = default;
  /// boxes[i] is the box of instance i.
  [[nodiscard]] static TopLevel build(std::span<const InstanceBox> boxes,
                                      TopLevelChoice choice = TopLevelChoice::kAuto);
  /// The same with some boxes replaced, each instance at most once; ids past the end add slots. Costs
  /// O(changes) and the blocks they touch. Built anew, in linear time, when half of the instances have
  /// changed since the last build, or when the grid's memory bound or the number of boxes outside the grid is
  /// passed.
  [[nodiscard]] TopLevel updated(std::span<const BoxChange> changes) const;

  /// Calls `visit(instance_id)` once for every instance that can hold a hit in [ray.tnear, far], roughly
  /// from near to far. `visit` returns the largest t still of interest (the best t so far; -infinity ends
  /// the walk), which narrows `far`. `ray` is valid.
  template <class Visit>
  void traverse(const Ray& ray, double far, const Visit& visit) const;

  [[nodiscard]] const Bounds3d& bounds() const { return bounds_; }  ///< holds every box
  [[nodiscard]] std::size_t slots() const { return entries_.size(); }
  [[nodiscard]] InstanceBox box(std::uint32_t instance_id) const { return entries_[instance_id].box(); }
  /// The instance that `traverse` can visit, where there is no other.
  [[nodiscard]] std::optional<std::uint32_t> sole_instance() const {
    return !grid_ && always_.size() == 1 ? std::optional(always_.front()) : std::nullopt;
  }
  [[nodiscard]] TopLevelKind kind() const {
    return grid_.has_value() ? TopLevelKind::kUniformGrid : TopLevelKind::kNone;
  }
  [[nodiscard]] std::size_t memory_bytes() const;
  [[nodiscard]] TopLevelStats stats() const;  ///< looks at every cell
  /// Every box is listed in exactly the cells of its range, in the order of ids, and nothing else is.
  [[nodiscard]] Status validate() const;

 private:
  [[nodiscard]] bool worth_rebuilding(std::size_t changes) const;
  void replace(const BoxChange& change, std::vector<RangeChange>& range_changes);

  /// A box test that allows for the ray's distance from this very box.
  template <class Visit>
  void test_alone(const WorldRay& ray, std::uint32_t id, double& far, const Visit& visit) const;
  template <class Visit>
  void walk(const WorldRay& ray, double distance, double far, const Visit& visit) const;

  ChunkedVector<Entry> entries_;
  std::optional<UniformGrid> grid_;
  std::vector<std::uint32_t> always_;  ///< ascending; all reachable instances when there is no grid
  Bounds3d bounds_;                    ///< union at the last build, extended since
  TopLevelChoice choice_ = TopLevelChoice::kAuto;
  std::size_t reachable_ = 0;            ///< instances with a box
  std::size_t changes_since_build_ = 0;  ///< boxes replaced or added
  std::size_t outside_at_build_ = 0;     ///< size of always_ then
  std::string reason_;
  double build_ms_ = 0.0;
};

template <class Visit>
void TopLevel::test_alone(const WorldRay& ray, std::uint32_t id, double& far, const Visit& visit) const {
  const Entry& entry = entries_[id];
  const double distance = ray.distance_to(entry.bounds);
  const double pad = double(entry.drift) * distance + rounding_slack(distance, entry.bounds);
  if (!intersect_box(ray, entry.bounds, pad, far).empty()) far = visit(id);
}

// An instance listed in several cells is tested in the first one that the ray visits. No mailbox is kept: an
// instance is listed in a box of cells, and the cells of a straight walk in such a box follow each other
// without a break (each index of the walk is monotone, so the steps inside the box are an interval on each
// axis). So this is not the first visit if and only if the cell before is in the box too; and as one index
// changes per step, that index alone tells. Nothing is written, so any number of threads may walk, and no ray
// ids can wrap.
template <class Visit>
void TopLevel::walk(const WorldRay& ray, double distance, double far, const Visit& visit) const {
  const double slack = rounding_slack(distance, grid_->layout().bounds);
  GridWalk walk(grid_->layout(), ray, far);
  CellSegment segment;
  while (walk.next(segment)) {
    const UniformGrid::CellAddress at = grid_->address(segment.cell);
    const GridBlock* block = grid_->block(at.block);
    if (block != nullptr) {
      for (const std::uint32_t id : block->list(at.local)) {
        const Entry& entry = entries_[id];
        if (segment.entered_axis >= 0) {
          const auto axis = std::size_t(segment.entered_axis);
          if (entry.range.lower[axis] <= segment.previous && segment.previous <= entry.range.upper[axis])
            continue;
        }
        if (!intersect_box(ray, entry.bounds, double(entry.drift) * distance + slack, far).empty())
          far = visit(id);
      }
    }
    // Whatever is still to come is hit at t_exit or later.
    if (far < segment.t_exit) return;
  }
}

template <class Visit>
void TopLevel::traverse(const Ray& ray, double far, const Visit& visit) const {
  const WorldRay world(ray);
  for (const std::uint32_t id : always_) test_alone(world, id, far, visit);
  if (!grid_) return;
  const double distance = world.distance_to(grid_->layout().bounds);
  if (distance <= grid_->layout().reach) {
    walk(world, distance, far, visit);
    return;
  }
  // From so far away rounding may carry a ray out of the cells of a box it hits: test every box.
  for (std::uint32_t id = 0; id < entries_.size(); ++id)
    if (!entries_[id].range.empty()) test_alone(world, id, far, visit);
}

}  // namespace gridcast::tlas
