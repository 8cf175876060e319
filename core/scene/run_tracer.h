#pragma once

#include <span>

#include "core/scene/batch_trace.h"
#include "core/scene/trace.h"

namespace gridcast::scene {

/// Traces runs of rays on the calling thread, the way batches are traced, for callers that have tasks of
/// their own: neighbours in a run that are neighbours in space go together. One for each thread; keeps a
/// reference to the scene.
class RunTracer {
 public:
  RunTracer(const Scene& scene, Precision precision, InstanceMask mask = kFullMask)
      : target_(scene, mask), precision_(precision) {}

  /// Answers as those of scene::intersect, ray by ray. `excluded` is empty or as long as `rays`.
  void intersect(std::span<const Ray> rays, std::span<const PrimitiveRef> excluded,
                 std::span<SurfaceHit> hits);
  /// Answers as those of scene::occluded.
  void occluded(std::span<const Ray> rays, std::span<const PrimitiveRef> excluded,
                std::span<RayStatus> status);

 private:
  void load(std::span<const Ray> rays, std::span<const PrimitiveRef> excluded);

  BatchTarget target_;
  Precision precision_;
  RayRun run_;
};

}  // namespace gridcast::scene
