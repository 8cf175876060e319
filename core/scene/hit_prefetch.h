#pragma once

#include <cstddef>

#include "core/scene/batch_trace.h"

namespace gridcast::scene {

/// Asks for what the answers of a run are made from before they are made. A hit leads to its instance, and
/// that to the tree with the triangle's corners: misses one after the other, which the hits of a run have
/// side by side so.
class HitPrefetch {
 public:
  HitPrefetch(const Scene& scene, const RayRun& run) : scene_(scene), run_(run) {}

  /// Called for every ray of the run, in order, before its answer is made.
  void before(std::size_t i) const {
    if (const Hit* hit = hit_of(i + 2 * kStep)) scene_.prefetch_instance(hit->instance_id);
    if (const Hit* hit = hit_of(i + kStep))
      scene_.blas(scene_.instance(hit->instance_id).mesh_id).prefetch_corners(*hit);
  }

 private:
  /// Answers between two steps: some twenty nanoseconds each, so that a miss has time.
  static constexpr std::size_t kStep = 8;

  [[nodiscard]] const Hit* hit_of(std::size_t i) const {
    return i < run_.rays.size() && run_.status[i] == RayStatus::kHit ? &run_.hits[i] : nullptr;
  }

  const Scene& scene_;
  const RayRun& run_;
};

}  // namespace gridcast::scene
