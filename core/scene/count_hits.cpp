#include <new>

#include <tbb/enumerable_thread_specific.h>

#include "core/scene/all_hits.h"
#include "core/scene/batch_loop.h"
#include "core/scene/crossing_count.h"
#include "core/scene/trace_one.h"

namespace gridcast::scene {
namespace {

constexpr std::size_t kRaysPerBlock = 512;

void count(const Scene& scene, const Ray& ray, const QueryFilter& filter, CrossingCount& counter) {
  counter.start(ray.tfar);
  mesh::ObjectRay object_ray;
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    const Instance instance = scene.instance(id);
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    if (prepare_for(object_ray, instance, blas, ray, ray.tfar, id, filter)) {
      counter.enter(blas.mesh());
      blas.intersect_every<Precision::kRobust>(object_ray, counter);
      counter.leave();
    }
    return ray.tfar;
  });
}

}  // namespace

Result<HitCounts> count_hits(const Scene& scene, const RayBatch& rays, const CountOptions& options) try {
  HitCounts out;
  out.resize(rays.size());
  tbb::enumerable_thread_specific<CrossingCount> counters;
  const bool whole = for_each_in_blocks(
      rays.size(), kRaysPerBlock, options.stop, options.progress, [&](std::size_t i, std::size_t /*block*/) {
        const Ray ray = rays[i];
        if (!is_valid(ray)) {
          out.status[i] = RayStatus::kInvalid;
          return true;
        }
        CrossingCount& counter = counters.local();
        const PrimitiveRef excluded = i < rays.excluded.size() ? rays.excluded[i] : PrimitiveRef{};
        count(scene, ray, {excluded, options.mask}, counter);
        out.status[i] = counter.hits() > 0 ? RayStatus::kHit : RayStatus::kMiss;
        out.count[i] = counter.hits();
        out.crossings[i] = counter.crossings();
        out.winding[i] = counter.winding();
        return true;
      });
  if (!whole) return Error{ErrorCode::kCancelled, "the trace was cancelled", ""};
  return out;
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the answers", ""};
}

}  // namespace gridcast::scene
