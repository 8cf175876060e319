#pragma once
// Answers of queries that list or count all hits of a ray.

#include <cstdint>
#include <limits>
#include <vector>

#include "core/math/ray_batch.h"

namespace gridcast {

/// A place in the order of the hits of a ray, (t, instance_id, primitive_id). The default is before all.
struct HitPosition {
  double t = -std::numeric_limits<double>::infinity();
  std::uint32_t instance_id = 0;
  std::uint32_t primitive_id = 0;
  friend bool operator==(const HitPosition&, const HitPosition&) = default;
};

inline bool is_behind(const Hit& hit, const HitPosition& position) {
  return closer({.t = position.t, .instance_id = position.instance_id, .primitive_id = position.primitive_id},
                hit);
}

/// Hits of N rays, those of ray i in rows [splits[i], splits[i + 1]), in order.
struct HitLists {
  std::vector<RayStatus> status;      ///< [N] kMiss, kHit, kTruncated (there are more), kInvalid
  std::vector<std::uint64_t> splits;  ///< [N + 1]
  HitColumns hits;                    ///< its status stays empty
};

/// Counts of N rays; see scene::count_hits.
struct HitCounts {
  std::vector<RayStatus> status;         ///< [N] kMiss, kHit, kInvalid
  std::vector<std::uint32_t> count;      ///< [N] triangles hit
  std::vector<std::uint32_t> crossings;  ///< [N] passages through a surface
  std::vector<std::int32_t> winding;     ///< [N] passages out less passages in

  void resize(std::size_t n) {
    status.assign(n, RayStatus::kMiss);
    count.assign(n, 0);
    crossings.assign(n, 0);
    winding.assign(n, 0);
  }
};

}  // namespace gridcast
