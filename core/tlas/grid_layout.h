#pragma once

#include <algorithm>
#include <cstdint>

#include "core/tlas/instance_box.h"
#include "core/tlas/world_ray.h"

namespace gridcast::tlas {

/// Most cells along an axis: indices fit 16 bits.
inline constexpr std::uint32_t kMaxCellsPerAxis = 65535;

/// Where the cells of a grid are. Planes are lower + k * cell in double, always computed like that, so that
/// the walk and the filing of boxes agree.
struct GridLayout {
  Bounds3d bounds;
  Vec3d cell{1.0};  ///< size of a cell in metres
  Vec3d inverse_cell{1.0};
  std::uint32_t cells[3] = {1, 1, 1};
  /// Rays that start farther than this from some point of the bounds are not walked: boxes are filed with
  /// room for the drift over this distance only.
  double reach = 0.0;

  [[nodiscard]] std::uint64_t cell_count() const { return std::uint64_t(cells[0]) * cells[1] * cells[2]; }
  [[nodiscard]] double plane(int axis, std::int64_t k) const {
    return bounds.lower[axis] + double(k) * cell[axis];
  }
  /// Index of the cell that holds coordinate x, clamped to the grid. Monotone in x.
  [[nodiscard]] std::uint16_t cell_of(int axis, double x) const {
    const double index = (x - bounds.lower[axis]) * inverse_cell[axis];
    return std::uint16_t(std::clamp(index, 0.0, double(cells[axis] - 1)));
  }
  /// Room around a box: what a hit of a ray from within reach can stray, and the rounding of the walk.
  [[nodiscard]] double pad(float drift) const {
    return double(drift) * reach + rounding_slack(reach, bounds);
  }
  /// The cells that list a box; empty when the box with its room leaves the grid (or is empty).
  [[nodiscard]] CellRange range_of(const InstanceBox& box) const {
    const double room = pad(box.drift);
    const Bounds3d grown{box.bounds.lower - Vec3d(room), box.bounds.upper + Vec3d(room)};
    CellRange range;
    if (box.bounds.empty() || !bounds.contains(grown)) return range;
    for (int axis = 0; axis < 3; ++axis) {
      range.lower[std::size_t(axis)] = cell_of(axis, grown.lower[axis]);
      range.upper[std::size_t(axis)] = cell_of(axis, grown.upper[axis]);
    }
    return range;
  }
};

}  // namespace gridcast::tlas
