#pragma once
// Queries about every hit of a ray.

#include <cstdint>
#include <span>
#include <stop_token>

#include "core/math/hit_lists.h"
#include "core/scene/scene.h"

namespace gridcast::scene {

struct AllHitsOptions {
  Precision precision = Precision::kRobust;  ///< kUnsupported for kExact
  HitField fields = HitField::kAll;
  std::uint32_t max_hits = 65536;             ///< of a ray, at least 1: the nearest are kept
  std::uint64_t max_total_hits = 1ULL << 22;  ///< of the batch: more is an error
  /// One a ray, or none: only hits strictly behind it are given. A truncated ray goes on with the position
  /// of its last hit, and no hit is lost or repeated, however many lie at the same t.
  std::span<const HitPosition> after;
  std::stop_token stop;  ///< checked at every ray
  ProgressCallback progress;
  InstanceMask mask = kFullMask;  ///< which instances the rays see
};

/// All hits in [tnear, tfar] of every ray, each once, ordered by (t, instance_id, primitive_id): the same
/// bits whatever the structures, threads and order of rays. The first is the closest hit. Errors: kCancelled,
/// kLimitExceeded when all hits together are more than max_total_hits.
[[nodiscard]] Result<HitLists> intersect_all(const Scene& scene, const RayBatch& rays,
                                             const AllHitsOptions& options);

struct CountOptions {
  std::stop_token stop;  ///< checked at every ray
  ProgressCallback progress;
  InstanceMask mask = kFullMask;  ///< which instances the rays see
};

/// How many triangles every ray hits in [tnear, tfar], which counts a shared edge twice, and how often it
/// passes through a surface, which does not (mesh::line_crossing). With tfar infinite and meshes that have an
/// inside, `winding` is the sum of their winding numbers around the origin, and `crossings` is even outside.
/// Decided as by Precision::kRobust. A crossing is in the range when its t, as reported, is; at tnear = 0 it
/// is decided exactly, an origin on the surface being moved off it as mesh::is_ahead says. Error: kCancelled.
[[nodiscard]] Result<HitCounts> count_hits(const Scene& scene, const RayBatch& rays,
                                           const CountOptions& options);

}  // namespace gridcast::scene
