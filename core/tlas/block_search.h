#pragma once
// Rays that start so far away that rounding may carry their hits out of the cells of an instance.

#include <algorithm>

#include "core/tlas/grid_layout.h"
#include "core/tlas/uniform_grid.h"

namespace gridcast::tlas {

/// Halves the box of blocks until single ones, keeping those that the ray may pass. The room for that is what
/// the ray's distance asks for by the largest drift of any box.
///
/// An instance that reaches into several blocks is tested in one of them. With p the point where the ray
/// comes into its box (grown by its own pad, as tested), the cell of p, moved to the nearest one of the
/// instance's range, is in that block: a choice that depends on nothing but ray and box. The block is
/// reached, since on each axis p is either in it or at most the instance's pad from the box, thus from the
/// range and the block, up to the rounding of p, of the index and of the slab test, each less than
/// rounding_slack.
///
/// `visit` has far(), the largest t still of interest, and test(block, span of the ray in the block, grid's
/// block or null), which returns whether to go on.
template <class Visit>
class BlockSearch {
 public:
  BlockSearch(const UniformGrid& grid, const WorldRay& ray, Visit& visit)
      : grid_(grid), layout_(grid.layout()), ray_(ray), visit_(visit) {
    const double distance = ray.distance_to(layout_.bounds);
    // Three roundings as above, and those of the test of a box alone.
    pad_ = double(grid.max_drift()) * distance + 4.0 * rounding_slack(distance, layout_.bounds);
  }

  void run() {
    CellRange all{{0, 0, 0}, {}};
    for (std::size_t axis = 0; axis < 3; ++axis) all.upper[axis] = std::uint16_t(layout_.blocks[axis] - 1);
    descend(all);
  }

 private:
  bool descend(const CellRange& blocks) {
    Bounds3d bounds;
    int longest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = std::size_t(axis);
      bounds.lower[axis] = layout_.plane(axis, std::int64_t(blocks.lower[a]) << layout_.shift[axis]);
      bounds.upper[axis] = layout_.plane(axis, std::int64_t(blocks.upper[a] + 1) << layout_.shift[axis]);
      const auto l = std::size_t(longest);
      if (blocks.upper[a] - blocks.lower[a] > blocks.upper[l] - blocks.lower[l]) longest = axis;
    }
    const Span span = intersect_box(ray_, bounds, pad_, visit_.far());
    if (span.empty()) return true;
    const auto axis = std::size_t(longest);
    if (blocks.lower[axis] == blocks.upper[axis]) {
      const Cell& b = blocks.lower;
      return visit_.test(b, span, grid_.block((b[2] * layout_.blocks[1] + b[1]) * layout_.blocks[0] + b[0]));
    }
    const int middle = (int(blocks.lower[axis]) + int(blocks.upper[axis])) / 2;
    CellRange lower = blocks, upper = blocks;
    lower.upper[axis] = std::uint16_t(middle);
    upper.lower[axis] = std::uint16_t(middle + 1);
    const bool forward = ray_.direction[longest] >= 0.0;
    return descend(forward ? lower : upper) && descend(forward ? upper : lower);
  }

  const UniformGrid& grid_;
  const GridLayout& layout_;
  const WorldRay& ray_;
  Visit& visit_;
  double pad_;
};

/// The block in which an instance is tested that the ray enters at `t_enter`.
[[nodiscard]] inline Cell block_to_test_in(const GridLayout& layout, const WorldRay& ray,
                                           const InstanceBox& box, double t_enter) {
  const CellRange range = layout.range_of(box);
  Cell block;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = std::size_t(axis);
    const std::uint16_t cell = layout.cell_of(axis, ray.origin[axis] + t_enter * ray.direction[axis]);
    block[a] = std::uint16_t(std::clamp(cell, range.lower[a], range.upper[a]) >> layout.shift[axis]);
  }
  return block;
}

}  // namespace gridcast::tlas
