#include "core/scene/visibility.h"

#include <cmath>
#include <limits>

#include "core/scene/made_rays.h"

namespace gridcast::scene {
namespace {

/// The open segment as a ray. What cannot be blocked becomes an empty range.
Ray segment(const Vec3d& from, const Vec3d& to, double margin) {
  if (!is_valid_point(from) || !is_valid_point(to)) return {from, Vec3d(0.0)};
  Ray ray{from, to - from};
  if (max_abs(ray.direction) < kMinRayDirection) return {from, Vec3d(1.0, 0.0, 0.0), 1.0, 0.0};
  ray.tnear = std::numeric_limits<double>::min();
  ray.tfar = std::nextafter(1.0, 0.0);
  if (margin > 0.0) {
    // Scaled to 1, so that no square leaves the range of double.
    const double size = max_abs(ray.direction);
    ray.tnear = std::max(ray.tnear, margin / (size * glm::length(ray.direction / size)));
    ray.tfar = std::min(ray.tfar, 1.0 - ray.tnear);
  }
  return ray;
}

MadeRays segments(const PairBatch& pairs, double margin) {
  return {pairs.size(),
          [pairs, margin](std::size_t i) { return segment(pairs.from(i), pairs.to(i), margin); },
          pairs.excluded};
}

/// Where the first surface is the target, nothing is between the two.
void arrive(const PairBatch& pairs, HitColumns& hits) {
  for (std::size_t i = 0; i < pairs.targets.size(); ++i)
    if (hits.status[i] == RayStatus::kHit &&
        pairs.targets[i] == PrimitiveRef{hits.instance_id[i], hits.primitive_id[i]})
      hits.set(i, SurfaceHit{});
}

}  // namespace

Result<HitColumns> first_blockers(const Scene& scene, const PairBatch& pairs,
                                  const VisibilityOptions& options) {
  TraceOptions trace = options.trace;
  if (!pairs.targets.empty()) trace.fields = trace.fields | HitField::kInstanceId | HitField::kPrimitiveId;
  auto hits = intersect(scene, segments(pairs, options.margin), trace);
  if (!hits) return hits;
  arrive(pairs, *hits);
  if (!has(options.trace.fields, HitField::kInstanceId)) hits->instance_id.clear();
  if (!has(options.trace.fields, HitField::kPrimitiveId)) hits->primitive_id.clear();
  return hits;
}

Result<std::vector<RayStatus>> blocked(const Scene& scene, const PairBatch& pairs,
                                       const VisibilityOptions& options) {
  if (pairs.targets.empty()) return occluded(scene, segments(pairs, options.margin), options.trace);
  VisibilityOptions closest = options;
  closest.trace.fields = HitField{};
  auto hits = first_blockers(scene, pairs, closest);
  if (!hits) return hits.error();
  return std::move(hits->status);
}

}  // namespace gridcast::scene
