#pragma once
// Queries about points: what surface is nearest, and what they are inside of.

#include <cstdint>
#include <limits>
#include <span>
#include <stop_token>

#include "core/math/point_batch.h"
#include "core/scene/scene.h"

namespace gridcast::scene {

struct NearestOptions {
  /// Metres; farther surfaces do not count.
  double max_distance = std::numeric_limits<double>::infinity();
  std::stop_token stop;  ///< checked at every point
  ProgressCallback progress;
  InstanceMask mask = kFullMask;  ///< which instances count
};

/// The nearest surface point of the scene for every point, by (distance, instance_id, primitive_id): the same
/// bits whatever the structures and threads. Distances are measured in world space, between the point and
/// the triangle's corners as transformed in double. Error: kCancelled.
[[nodiscard]] Result<NearestColumns> nearest_points(const Scene& scene, const PointBatch& points,
                                                    const NearestOptions& options);

struct InsideOptions {
  std::uint64_t max_total_rows = 1ULL << 22;  ///< of the answer: more is an error
  std::stop_token stop;                       ///< checked at every point
  ProgressCallback progress;
  InstanceMask mask = kFullMask;  ///< which instances count
};

/// The winding number of every point in every instance, by the signed crossings of a ray, and whether it lies
/// on a triangle; both exact for the point as transformed to object space in double. The orientation of a
/// mesh counts in object space, so a mirrored instance still has its inside inside. A mesh without an inside
/// (mesh::has_inside) has no winding number: points in the box of an instance of it are kUnknown at best.
/// Errors: kCancelled, kLimitExceeded.
[[nodiscard]] Result<InsideColumns> points_inside(const Scene& scene, const PointBatch& points,
                                                  const InsideOptions& options);

}  // namespace gridcast::scene
