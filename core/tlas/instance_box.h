#pragma once

#include <cstdint>

#include "core/math/bounds.h"

namespace gridcast::tlas {

/// What the top level knows of an instance. A hit of it lies in `bounds` grown by drift * D on every side,
/// where D is at least the distance (largest component) from the ray's origin to any point of `bounds`:
/// the rounding of the world-to-object transform, which grows with the distance. Empty bounds: never hit.
struct InstanceBox {
  Bounds3d bounds;
  double drift = 0.0;
  friend bool operator==(const InstanceBox&, const InstanceBox&) = default;
};

/// A new box for an instance; an id past the end adds slots up to it.
struct BoxChange {
  std::uint32_t instance_id = 0;
  InstanceBox box;
};

}  // namespace gridcast::tlas
