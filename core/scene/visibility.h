#pragma once
// Do two points see each other, and if not, what is between them?

#include <stop_token>
#include <vector>

#include "core/math/pair_batch.h"
#include "core/scene/trace.h"

namespace gridcast::scene {

/// Of `trace` all counts but `fields`, where only a yes or no is asked for.
struct VisibilityOptions {
  TraceOptions trace;
  /// Metres, not negative: what lies nearer to one of the two points does not block. For points that were
  /// measured or rounded, so that the surface that they lie on is not in their way.
  double margin = 0.0;
};

/// What lies on the open segment between the points of every pair blocks it: a surface that one of the two
/// lies on exactly does not. Points found as hits lie on their surface but for rounding; name its triangle:
/// `excluded` is never hit, and a segment whose first surface is its `target` has arrived, so nothing blocks.
/// A point on an edge or corner has several triangles: there a margin helps.
///
/// The segment is from + t (to - from), the difference rounded to double, and t a fraction of its length.
/// Points nearer to each other than kMinRayDirection or than two margins see each other. Row i of the answer
/// is the first blocker of pair i, by (t, instance_id, primitive_id), with status kHit; kMiss where both see
/// each other; kInvalid where a point is not (is_valid_point). Errors: kCancelled, kLimitExceeded (memory).
[[nodiscard]] Result<HitColumns> first_blockers(const Scene& scene, const PairBatch& pairs,
                                                const VisibilityOptions& options);
/// The statuses alone, which cost less where pairs have no targets.
[[nodiscard]] Result<std::vector<RayStatus>> blocked(const Scene& scene, const PairBatch& pairs,
                                                     const VisibilityOptions& options);

}  // namespace gridcast::scene
