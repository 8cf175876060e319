#pragma once
// Looks at a batch before it is traced, and sorts it where that pays.

#include <vector>

#include "core/math/ray_batch.h"
#include "core/scene/scene.h"
#include "core/scene/trace_stats.h"

namespace gridcast::scene {

struct RayOrder {
  RayOrderKind kind = RayOrderKind::kAsGiven;
  std::vector<std::uint32_t> permutation;  ///< the rays in the order to trace them; empty when as given
  std::vector<std::uint32_t> places;       ///< where each ray is in that order; empty when as given
};

/// Looks at a sample of the batch and sorts all of it when neighbours in the batch are strangers in space.
/// Sets `order`, `reason` and `order_ms` of `stats`.
[[nodiscard]] RayOrder choose_order(const Scene& scene, const RayBatch& rays, TraceStats& stats);

}  // namespace gridcast::scene
