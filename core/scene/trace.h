#pragma once

#include <cstddef>
#include <span>
#include <stop_token>
#include <vector>

#include "core/math/ray_batch.h"
#include "core/scene/scene.h"
#include "core/scene/trace_stats.h"

namespace gridcast::scene {

/// Closest hit of one world ray. Invalid rays get RayStatus::kInvalid. Never fails, never throws.
/// `excluded`: the primitive the ray starts on. `mask`: which instances it sees. SurfaceHit::t_error is left
/// to scene::t_error.
[[nodiscard]] SurfaceHit intersect(const Scene& scene, const Ray& ray,
                                   Precision precision = Precision::kRobust, PrimitiveRef excluded = {},
                                   InstanceMask mask = kFullMask);

/// Whether anything lies in [tnear, tfar]: kHit, kMiss or kInvalid.
[[nodiscard]] RayStatus occluded(const Scene& scene, const Ray& ray, Precision precision = Precision::kRobust,
                                 PrimitiveRef excluded = {}, InstanceMask mask = kFullMask);

struct TraceOptions {
  Precision precision = Precision::kRobust;
  HitField fields = HitField::kAll;
  std::stop_token stop;  ///< looked at between rays, and between packets of 16
  ProgressCallback progress;
  TraceStats* stats = nullptr;    ///< where to say how the batch was traced; null = nobody asks
  InstanceMask mask = kFullMask;  ///< which instances the rays see
};

/// A batch over all cores, answers in the order of the rays. Errors: kCancelled; kLimitExceeded where memory
/// is not enough.
[[nodiscard]] Result<HitColumns> intersect(const Scene& scene, const RayBatch& rays,
                                           const TraceOptions& options);
[[nodiscard]] Result<std::vector<RayStatus>> occluded(const Scene& scene, const RayBatch& rays,
                                                      const TraceOptions& options);

/// The same into rows `first` and on of columns that have room for them, and options.fields; after an error
/// those rows mean nothing. For batches that come in pieces, and for callers that keep their memory.
[[nodiscard]] Status intersect_into(const Scene& scene, const RayBatch& rays, const TraceOptions& options,
                                    HitColumns& hits, std::size_t first);
/// Into as many statuses as there are rays.
[[nodiscard]] Status occluded_into(const Scene& scene, const RayBatch& rays, const TraceOptions& options,
                                   std::span<RayStatus> status);

}  // namespace gridcast::scene
