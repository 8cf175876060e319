#pragma once

#include <algorithm>

#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

/// Walks the cells along a ray: "A Fast Voxel Traversal Algorithm for Ray Tracing", J. Amanatides, 1987.
/// Unlike the paper, the t of a plane is computed from its number each time instead of being summed up, so
/// errors do not grow along the ray, and whole blocks of cells can be left at once.
///
/// Why no box is lost. Each cell has a segment of t, which begins where the one before ends. For every t of a
/// segment the point o + t d lies in the segment's cell grown by less than rounding_slack: on each axis t is
/// at most the t of the far plane, which was computed to within the slack, and the same held for the near
/// plane when it was crossed. Boxes are filed with at least that slack around them, so the cell of any hit of
/// an instance lists the instance. Every step moves one index one cell in the direction of the ray, and a
/// walk ends where an index leaves the grid: at most nx + ny + nz - 2 cells, in any case.
///
/// Leaving a block crosses the same planes in the same order as single steps do, by (t, axis); so the cells
/// of a walk do not depend on which blocks were left at once.
class GridWalk {
 public:
  GridWalk(const GridLayout& layout, const WorldRay& ray, double far) : layout_(layout) {
    const Span span = intersect_box(ray, layout.bounds, 0.0, far);
    done_ = span.empty();
    if (done_) return;
    t_enter_ = start_ = span.enter;
    end_ = span.exit;
    for (int axis = 0; axis < 3; ++axis) {
      const bool forward = ray.direction[axis] >= 0.0;
      index_[axis] = layout.cell_of(axis, ray.origin[axis] + span.enter * ray.direction[axis]);
      step_[axis] = forward ? 1 : -1;
      base_[axis] = (layout.bounds.lower[axis] - ray.origin[axis]) * ray.inverse[axis];
      delta_[axis] = layout.cell[axis] * ray.inverse[axis];
      set_plane(axis);
    }
    choose_axis();
  }

  [[nodiscard]] bool done() const { return done_; }
  [[nodiscard]] Cell cell() const {
    return {std::uint16_t(index_[0]), std::uint16_t(index_[1]), std::uint16_t(index_[2])};
  }
  [[nodiscard]] std::uint32_t block() const {
    return layout_.block_of(std::uint32_t(index_[0]), std::uint32_t(index_[1]), std::uint32_t(index_[2]));
  }
  [[nodiscard]] std::uint32_t local() const {
    return layout_.local_of(std::uint32_t(index_[0]), std::uint32_t(index_[1]), std::uint32_t(index_[2]));
  }
  /// Where the cell before lies: 2 axis when it is before this one along the axis, 2 axis + 1 when it is
  /// after it, 6 in the first cell. See BoxGroup::seen.
  [[nodiscard]] int from() const { return from_; }
  [[nodiscard]] double t_enter() const { return t_enter_; }
  [[nodiscard]] double t_exit() const { return std::clamp(next_t_[axis_], t_enter_, end_); }
  /// t at which the ray comes into and leaves the grid, within [tnear, far].
  [[nodiscard]] double start() const { return start_; }
  [[nodiscard]] double end() const { return end_; }

  /// To the next cell; false when that is in another block or there is none.
  bool step() {
    const int axis = axis_;
    const double t = next_t_[axis];
    const std::int32_t before = index_[axis];
    index_[axis] += step_[axis];
    set_plane(axis);
    arrive(axis, t);
    return ((before ^ index_[axis]) >> layout_.shift[axis]) == 0 && !done_;
  }

  /// To the first cell outside of the block.
  void leave_block() {
    int exit_axis = 0;
    double exit_t = 0.0;
    std::int32_t exit_index = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const std::int32_t block = index_[axis] >> layout_.shift[axis];
      const std::int32_t plane = (step_[axis] > 0 ? block + 1 : block) * (1 << layout_.shift[axis]);
      const double t = base_[axis] + double(plane) * delta_[axis];
      if (axis > 0 && !(t < exit_t)) continue;
      exit_axis = axis;
      exit_t = t;
      exit_index = step_[axis] > 0 ? plane : plane - 1;
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (axis == exit_axis) continue;
      while (next_t_[axis] < exit_t || (next_t_[axis] == exit_t && axis < exit_axis)) {
        index_[axis] += step_[axis];
        set_plane(axis);
      }
    }
    index_[exit_axis] = exit_index;
    set_plane(exit_axis);
    for (int axis = 0; axis < 3; ++axis) done_ = done_ || outside(axis);
    arrive(exit_axis, exit_t);
  }

 private:
  /// t at which the ray leaves its cell through a plane of this axis.
  void set_plane(int axis) {
    next_t_[axis] = base_[axis] + double(index_[axis] + (step_[axis] > 0 ? 1 : 0)) * delta_[axis];
  }
  [[nodiscard]] bool outside(int axis) const { return std::uint32_t(index_[axis]) >= layout_.cells[axis]; }
  void choose_axis() {
    axis_ =
        next_t_[0] <= next_t_[1] ? (next_t_[0] <= next_t_[2] ? 0 : 2) : (next_t_[1] <= next_t_[2] ? 1 : 2);
  }
  void arrive(int axis, double t) {
    from_ = 2 * axis + (step_[axis] > 0 ? 0 : 1);
    done_ = done_ || t >= end_ || outside(axis);
    t_enter_ = std::max(t_enter_, t);
    choose_axis();
  }

  const GridLayout& layout_;
  std::int32_t index_[3] = {0, 0, 0};
  std::int32_t step_[3] = {1, 1, 1};
  double next_t_[3] = {0.0, 0.0, 0.0};
  double base_[3] = {0.0, 0.0, 0.0};
  double delta_[3] = {0.0, 0.0, 0.0};
  double start_ = 0.0, end_ = 0.0, t_enter_ = 0.0;
  int axis_ = 0;  ///< of the plane through which the ray leaves the cell
  int from_ = 6;
  bool done_ = true;
};

}  // namespace gridcast::tlas
