#pragma once

#include <algorithm>
#include <cmath>

#include "core/math/bounds.h"
#include "core/math/ray.h"

namespace gridcast::tlas {

/// A world ray prepared for slab tests and cell walks in double that lose nothing. Components of the
/// direction below 2^-60 of the largest are moved away from 0 (keeping their sign bit): over the distance
/// D the ray strays by less than 2^-59 D, which `slack` covers, and no division by zero, no NaN and no
/// special case for +0 or -0 remains.
struct WorldRay {
  Vec3d origin;
  Vec3d direction;  ///< no component is 0
  Vec3d inverse;    ///< finite
  double tnear;
  double distance;  ///< D: at least the distance (largest component) from the origin to any point of `scene`
  double slack;     ///< covers the rounding of slab tests and of the walk, in metres

  /// `scene` is not empty and holds everything that will be tested. `ray` is valid.
  WorldRay(const Ray& ray, const Bounds3d& scene) : origin(ray.origin), tnear(ray.tnear) {
    const double smallest = 0x1p-60 * max_abs(ray.direction);
    for (int axis = 0; axis < 3; ++axis) {
      const double d = ray.direction[axis];
      direction[axis] = std::abs(d) < smallest ? std::copysign(smallest, d) : d;
      inverse[axis] = 1.0 / direction[axis];
    }
    const Vec3d to_lower = glm::abs(origin - scene.lower), to_upper = glm::abs(origin - scene.upper);
    distance = max_abs(glm::max(to_lower, to_upper)) * (1.0 + 0x1p-50);
    slack = slack_at(distance, scene);
  }

  /// With u = 2^-53, m = the scene's largest coordinate and |o| <= m + D: a plane of the grid is off by at
  /// most 3u m, its difference from the origin by u D, the product with the inverse by 3u D; the point
  /// where a ray enters by 4u (m + D); a cell index by 3u of the scene's extent. 32u leaves more than twice
  /// that.
  static double slack_at(double distance, const Bounds3d& scene) {
    return 0x1p-48 * (scene.magnitude() + distance) + 0x1p-300;
  }
};

/// Where the ray is in a box, as an interval of t clipped to [tnear, far]; empty when enter > exit.
struct Span {
  double enter, exit;
  [[nodiscard]] bool empty() const { return !(enter <= exit); }
};

/// Slab test against `box` grown by `pad` (at least ray.slack, so that rounding loses nothing).
inline Span intersect_box(const WorldRay& ray, const Bounds3d& box, double pad, double far) {
  Span span{ray.tnear, far};
  for (int axis = 0; axis < 3; ++axis) {
    const double low = ((box.lower[axis] - pad) - ray.origin[axis]) * ray.inverse[axis];
    const double high = ((box.upper[axis] + pad) - ray.origin[axis]) * ray.inverse[axis];
    span.enter = std::max(span.enter, std::min(low, high));
    span.exit = std::min(span.exit, std::max(low, high));
  }
  return span;
}

}  // namespace gridcast::tlas
