#pragma once
// One ray's way through both levels, step by step.

#include <cstddef>
#include <stop_token>
#include <vector>

#include "core/math/hit.h"
#include "core/math/instance_mask.h"
#include "core/math/ray_way.h"
#include "core/scene/scene.h"

namespace gridcast::scene {

struct ExplainOptions {
  Precision precision = Precision::kRobust;
  PrimitiveRef excluded{};        ///< the primitive the ray starts on
  std::size_t max_steps = 10000;  ///< at least 1
  std::stop_token stop{};         ///< checked at every step
  InstanceMask mask = kFullMask;  ///< which instances the ray sees
};

struct Explanation {
  SurfaceHit hit;              ///< that of `intersect`, bit for bit, also where the way is cut
  std::vector<WayStep> steps;  ///< in the order of events
  WayCounts counts;            ///< of `steps`
  bool is_truncated = false;   ///< the way goes on after max_steps
};

/// What `intersect` does for one world ray: the cells that it passes, the instances that it looks at and
/// those it passes over, the nodes and leaves of their trees, every triangle, and what became of the best
/// hit. The decisions are those of the kernels in use (core/blas/explain.h says what is told otherwise). An
/// invalid ray has RayStatus::kInvalid and no steps. kCancelled on `stop`; kLimitExceeded without the memory.
[[nodiscard]] Result<Explanation> explain(const Scene& scene, const Ray& ray, const ExplainOptions& options);

}  // namespace gridcast::scene
