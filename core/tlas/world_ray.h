#pragma once

#include <algorithm>
#include <cmath>

#include "core/math/bounds.h"
#include "core/math/ray.h"
#include "core/tlas/instance_box.h"

namespace gridcast::tlas {

/// A world ray prepared for slab tests and cell walks in double that lose nothing. Components of the
/// direction below 2^-60 of the largest are moved away from 0 (keeping their sign bit): over a distance D
/// the ray strays by less than 2^-59 D, which the slack covers, and no division by zero, no NaN and no
/// special case for +0 or -0 remains.
struct WorldRay {
  Vec3d origin;
  Vec3d direction;  ///< no component is 0
  Vec3d inverse;    ///< finite
  double tnear;

  WorldRay() = default;  ///< nothing is set
  explicit WorldRay(const Ray& ray) : origin(ray.origin), tnear(ray.tnear) {
    const double smallest = 0x1p-60 * max_abs(ray.direction);
    for (int axis = 0; axis < 3; ++axis) {
      const double d = ray.direction[axis];
      direction[axis] = std::abs(d) < smallest ? std::copysign(smallest, d) : d;
      inverse[axis] = 1.0 / direction[axis];
    }
  }

  /// At least the distance (largest component) from the origin to any point of `bounds`, which is not empty.
  [[nodiscard]] double distance_to(const Bounds3d& bounds) const {
    return max_abs(glm::max(glm::abs(origin - bounds.lower), glm::abs(origin - bounds.upper))) *
           (1.0 + 0x1p-50);
  }
};

/// Covers the rounding of slab tests and of the walk for a ray that starts at most D = `distance` from
/// everything in `bounds`. With u = 2^-53, m the largest coordinate of the bounds and |o| <= m + D, in units
/// of length: the t of a plane is off by at most 10u D (base: a difference, an inverse and a product, 3u D; k
/// cells, whose extent is at most 2 D: 6u D; their sum: u D), the point where a ray enters by 4u (m + D), a
/// cell index by 3u of the extent, 6u D. 64u is three times the sum.
inline double rounding_slack(double distance, const Bounds3d& bounds) {
  return 0x1p-47 * (bounds.magnitude() + distance) + 0x1p-300;
}

/// Where the ray is in a box, as an interval of t clipped to [tnear, far]; empty when enter > exit.
struct Span {
  double enter, exit;
  [[nodiscard]] bool empty() const { return !(enter <= exit); }
};

/// Slab test against `bounds` grown by `pad`. Loses nothing that lies in the bounds grown by
/// pad - rounding_slack.
inline Span intersect_box(const WorldRay& ray, const Bounds3d& bounds, double pad, double far) {
  Span span{ray.tnear, far};
  for (int axis = 0; axis < 3; ++axis) {
    const double low = ((bounds.lower[axis] - pad) - ray.origin[axis]) * ray.inverse[axis];
    const double high = ((bounds.upper[axis] + pad) - ray.origin[axis]) * ray.inverse[axis];
    span.enter = std::max(span.enter, std::min(low, high));
    span.exit = std::min(span.exit, std::max(low, high));
  }
  return span;
}

/// Slab test that allows for the ray's distance from this very box: loses no hit of the instance.
inline Span intersect_alone(const WorldRay& ray, const InstanceBox& box, double far) {
  const double distance = ray.distance_to(box.bounds);
  const double pad = double(box.drift) * distance + rounding_slack(distance, box.bounds);
  return intersect_box(ray, box.bounds, pad, far);
}

}  // namespace gridcast::tlas
