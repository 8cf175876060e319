#pragma once

#include <algorithm>
#include <cstdint>

#include "core/math/bounds.h"

namespace gridcast::tlas {

/// What to do with an instance near a point, without its type.
struct NearVisitor {
  const void* object;
  /// Returns the largest distance still of interest.
  double (*visit)(const void* object, std::uint32_t instance_id);
};

/// A lower bound of the distance (Euclidean) from a point to anything in a box, rounding included: each
/// difference is off by less than 2^-52 of the largest coordinate. 0 inside.
inline double distance_below(const Vec3d& point, const Bounds3d& box) {
  const Vec3d outside = glm::max(glm::max(box.lower - point, point - box.upper), Vec3d(0.0));
  const double rounding = 0x1p-48 * (max_abs(point) + box.magnitude());
  return std::max(0.0, glm::length(outside) * (1.0 - 0x1p-40) - rounding);
}

}  // namespace gridcast::tlas
