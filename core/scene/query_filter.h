#pragma once

#include "core/math/instance_mask.h"
#include "core/math/ray.h"

namespace gridcast::scene {

/// What of a scene is not there for one ray.
struct QueryFilter {
  PrimitiveRef excluded;          ///< the primitive that the ray starts on
  InstanceMask mask = kFullMask;  ///< of the query: other instances are not seen
};

}  // namespace gridcast::scene
