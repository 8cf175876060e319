#pragma once

#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

/// The part of a ray in one cell.
struct CellSegment {
  Cell cell;
  int entered_axis;        ///< axis of the plane crossed from the cell before; -1 for the first cell
  std::uint16_t previous;  ///< index of the cell before along that axis
  double t_enter, t_exit;
};

/// Walks the cells along a ray, one segment per next(): "A Fast Voxel Traversal Algorithm for Ray Tracing",
/// J. Amanatides, 1987. Unlike the paper, the t of a plane is computed from the plane each time instead of
/// being summed up, so errors do not grow along the ray.
///
/// Why no box is lost. The segments cover the clipped ray without gap: each begins at the t where the one
/// before ends. For every t of a segment the point o + t d lies in the segment's cell grown by less than
/// rounding_slack: on each axis t is at most the t of the far plane, which was computed to within the slack,
/// and the same held for the near plane when it was crossed. Boxes are filed with at least that slack around
/// them, so the cell of any hit of an instance lists the instance. Every step moves one index one cell in the
/// direction of the ray, and a walk ends where an index leaves the grid: at most nx + ny + nz - 2 cells, in
/// any case.
class GridWalk {
 public:
  GridWalk(const GridLayout& layout, const WorldRay& ray, double far) : layout_(layout), ray_(ray) {
    const Span span = intersect_box(ray, layout.bounds, 0.0, far);
    done_ = span.empty();
    if (done_) return;
    segment_.t_exit = span.enter;
    end_ = span.exit;
    for (int axis = 0; axis < 3; ++axis) {
      index_[axis] = layout.cell_of(axis, ray.origin[axis] + span.enter * ray.direction[axis]);
      step_[axis] = ray.direction[axis] < 0.0 ? -1 : 1;
      next_t_[axis] = exit_t(axis);
    }
    axis_ = -1;
  }

  /// False at the end of the walk.
  bool next(CellSegment& segment) {
    if (done_) return false;
    segment_.entered_axis = axis_;
    if (axis_ >= 0) segment_.previous = std::uint16_t(index_[axis_] - step_[axis_]);
    segment_.cell = {std::uint16_t(index_[0]), std::uint16_t(index_[1]), std::uint16_t(index_[2])};
    axis_ =
        next_t_[0] <= next_t_[1] ? (next_t_[0] <= next_t_[2] ? 0 : 2) : (next_t_[1] <= next_t_[2] ? 1 : 2);
    segment_.t_enter = segment_.t_exit;
    segment_.t_exit = std::clamp(next_t_[axis_], segment_.t_enter, end_);
    segment = segment_;

    done_ = next_t_[axis_] >= end_;
    index_[axis_] += step_[axis_];
    if (index_[axis_] < 0 || index_[axis_] >= std::int64_t(layout_.cells[axis_])) done_ = true;
    next_t_[axis_] = exit_t(axis_);
    return true;
  }

 private:
  /// t at which the ray leaves its cell through a plane of this axis.
  [[nodiscard]] double exit_t(int axis) const {
    const std::int64_t plane = step_[axis] > 0 ? index_[axis] + 1 : index_[axis];
    return (layout_.plane(axis, plane) - ray_.origin[axis]) * ray_.inverse[axis];
  }

  const GridLayout& layout_;
  const WorldRay& ray_;
  std::int64_t index_[3] = {0, 0, 0};
  std::int64_t step_[3] = {1, 1, 1};
  double next_t_[3] = {0.0, 0.0, 0.0};
  double end_ = 0.0;
  CellSegment segment_{};
  int axis_ = -1;  // crossed last
  bool done_ = true;
};

}  // namespace gridcast::tlas
