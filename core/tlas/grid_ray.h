#pragma once

#include <algorithm>
#include <cmath>

#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

/// The part of a ray inside the grid, in floats from the grid's centre, for testing many boxes at once. As in
/// mesh::ObjectRay, distance is measured as s = (t - start) * scale, where the scale makes the largest
/// component of the direction 1, and the origin is where the ray comes into the grid.
///
/// With q = 2^-24 and E the largest extent of the grid, all coordinates are at most E / 2. Along one axis, in
/// units of length: reciprocal of the direction q E, origin q E / 2, two products and their difference 3 q E,
/// components of the direction below 2^-24 moved to that q E, the margin and s itself 2 q E: below 8 q E.
/// `pad` is twice that. (The double roundings before are covered by the slack that the boxes have.)
struct GridRay {
  float inverse[3];
  float near_offset[3];  ///< s at the near plane b of an axis is b * inverse + near_offset, at most
  float far_offset[3];   ///< s at the far plane b is b * inverse + far_offset, at least
  float pad;
  float s_near;  ///< lower bound of s in the grid
  double start, end, scale;

  /// The ray is in the grid from `t_start` to `t_end`.
  GridRay(const GridLayout& layout, const WorldRay& ray, double t_start, double t_end)
      : start(t_start), end(t_end), scale(max_abs(ray.direction)) {
    const Vec3d origin = (ray.origin + t_start * ray.direction) - layout.center;
    pad = float(0x1p-20 * max_abs(layout.bounds.extent()) + 0x1p-100);
    s_near = -pad;
    for (int axis = 0; axis < 3; ++axis) {
      inverse[axis] = float(std::clamp(ray.inverse[axis] * scale, -0x1p24, 0x1p24));
      const float offset = -(float(origin[axis]) * inverse[axis]);
      const float margin = pad * std::abs(inverse[axis]);
      near_offset[axis] = offset - margin;
      far_offset[axis] = offset + margin;
    }
  }
  /// Upper bound of s at t: nothing at distance t or less lies beyond it.
  [[nodiscard]] float s_far(double t) const {
    // Anything before the grid stands for -infinity, with which one cannot calculate.
    const double s = std::max((std::min(t, end) - start) * scale, -0x1p10 * double(pad));
    return float(s + std::abs(s) * 0x1p-22) + pad;
  }
};

}  // namespace gridcast::tlas
