#pragma once
// Batches whose rays are made while they are traced, for callers that have something shorter than rays.

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "core/math/ray_batch.h"
#include "core/scene/all_hits.h"
#include "core/scene/trace.h"

namespace gridcast::scene {

/// `count` rays by number. Made piece by piece, so that memory is bounded whatever the count.
struct MadeRays {
  std::size_t count = 0;
  /// The ray of a number below `count`; called from any thread. May be invalid: so is then its answer.
  std::function<Ray(std::size_t)> ray;
  /// As RayBatch::excluded.
  std::span<const PrimitiveRef> excluded = {};
};

/// What intersect() and occluded() of a RayBatch of the same rays would answer, bit for bit. Of
/// TraceOptions::stats the order is that of the last piece, the counts and times are sums.
[[nodiscard]] Result<HitColumns> intersect(const Scene& scene, const MadeRays& rays,
                                           const TraceOptions& options);
[[nodiscard]] Result<std::vector<RayStatus>> occluded(const Scene& scene, const MadeRays& rays,
                                                      const TraceOptions& options);

/// As intersect_all() of a RayBatch. AllHitsOptions::after is not looked at.
[[nodiscard]] Result<HitLists> intersect_all(const Scene& scene, const MadeRays& rays,
                                             const AllHitsOptions& options);

}  // namespace gridcast::scene
