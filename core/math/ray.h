#pragma once

#include <cstdint>
#include <limits>

#include "core/math/vec.h"

namespace gridcast {

/// A ray in world space. `t` is in units of the direction's length; the segment [tnear, tfar] is
/// closed at both ends, and empty when tnear > tfar. tfar may be +infinity, tnear may be negative.
struct Ray {
  Vec3d origin{0.0};
  Vec3d direction{0.0, 0.0, 1.0};
  double tnear = 0.0;
  double tfar = std::numeric_limits<double>::infinity();
};

/// A triangle of an instance; the default names none.
struct PrimitiveRef {
  std::uint32_t instance_id = kInvalidId;
  std::uint32_t primitive_id = kInvalidId;
  friend bool operator==(const PrimitiveRef&, const PrimitiveRef&) = default;
};

/// What became of a ray; the values are those of the wire format.
enum class RayStatus : std::uint8_t { kMiss = 0, kHit = 1, kAmbiguous = 2, kTruncated = 3, kInvalid = 4 };

/// `fast`: float triangle test, may lose a hit at an edge. `robust`: watertight. `exact`: as in real
/// arithmetic. See core/README.md.
enum class Precision : std::uint8_t { kFast, kRobust, kExact };

// Outside these limits products of four factors could leave the range of double.
inline constexpr double kMaxRayOrigin = 0x1p100;
inline constexpr double kMinRayDirection = 0x1p-200;
inline constexpr double kMaxRayDirection = 0x1p200;

/// Finite origin within kMaxRayOrigin, finite direction whose largest component lies within
/// [kMinRayDirection, kMaxRayDirection], tnear and tfar not NaN. Anything else gets kInvalid.
inline bool is_valid(const Ray& ray) {
  const double direction = max_abs(ray.direction);
  return max_abs(ray.origin) <= kMaxRayOrigin && is_finite(ray.origin) && is_finite(ray.direction) &&
         direction >= kMinRayDirection && direction <= kMaxRayDirection && !std::isnan(ray.tnear) &&
         !std::isnan(ray.tfar);
}

}  // namespace gridcast
