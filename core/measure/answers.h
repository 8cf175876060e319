#pragma once
// Answers to a whole ray set, and how two of them are compared.

#include <cstdint>
#include <vector>

#include "core/math/ray_batch.h"
#include "core/measure/embree_yardstick.h"
#include "core/measure/ray_sets.h"
#include "core/scene/scene.h"

namespace gridcast::measure {

/// Closest hits fill `hits`, any-hit queries `occluded`.
struct Answers {
  HitColumns hits;
  std::vector<RayStatus> occluded;

  void resize(std::size_t count, QueryKind query);
  [[nodiscard]] const std::vector<RayStatus>& status() const {
    return occluded.empty() ? hits.status : occluded;
  }
};

/// Rays whose answers differ in any bit of any column.
[[nodiscard]] std::uint64_t count_differences(const Answers& a, const Answers& b);
/// Rays that Embree answers otherwise: see CheckRow::embree_differs.
[[nodiscard]] std::uint64_t count_differences(const Answers& ours, const EmbreeAnswers& embree);
[[nodiscard]] std::uint64_t count_hits(const Answers& answers);

/// One ray at a time, as a program with its own loop would; writes rows [begin, end).
void trace_single(const scene::Scene& scene, const RaySet& rays, Precision precision, std::size_t begin,
                  std::size_t end, Answers& answers);

/// Compares rays spread over the set with a scene of brute force.
struct SampleCheck {
  std::uint64_t rays = 0, differs = 0;
};
[[nodiscard]] SampleCheck check_sample(const scene::Scene& brute_force, const RaySet& rays,
                                       Precision precision, std::size_t sample, const Answers& answers);

}  // namespace gridcast::measure
