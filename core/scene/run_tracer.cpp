#include "core/scene/run_tracer.h"

#include <algorithm>

#include "core/scene/geometric_normal.h"
#include "core/scene/hit_prefetch.h"
#include "core/scene/trace_one.h"

namespace gridcast::scene {

void RunTracer::load(std::span<const Ray> rays, std::span<const PrimitiveRef> excluded) {
  run_.rays.assign(rays.begin(), rays.end());
  run_.excluded.assign(excluded.begin(), excluded.end());
}

void RunTracer::intersect(std::span<const Ray> rays, std::span<const PrimitiveRef> excluded,
                          std::span<SurfaceHit> hits) {
  load(rays, excluded);
  for_precision(precision_,
                [&]<Precision kPrecision>() { (void)trace_run<kPrecision, false>(target_, run_, {}); });
  const HitPrefetch prefetch(target_.scene, run_);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    prefetch.before(i);
    hits[i] = {};
    hits[i].status = run_.status[i];
    if (run_.status[i] != RayStatus::kHit) continue;
    describe(target_.scene, run_.hits[i], hits[i]);
    hits[i].normal = geometric_normal(target_.scene, run_.hits[i], rays[i]);
  }
}

void RunTracer::occluded(std::span<const Ray> rays, std::span<const PrimitiveRef> excluded,
                         std::span<RayStatus> status) {
  load(rays, excluded);
  for_precision(precision_,
                [&]<Precision kPrecision>() { (void)trace_run<kPrecision, true>(target_, run_, {}); });
  std::copy(run_.status.begin(), run_.status.end(), status.begin());
}

}  // namespace gridcast::scene
