#pragma once
// Shots as a batch.

#include <cstddef>
#include <span>
#include <vector>

#include "core/math/ray_batch.h"
#include "tests/stability/scene_spec.h"

namespace gridcast::stability {

/// [N, 8] doubles of the rays.
inline std::vector<double> rows_of(std::span<const Shot> shots) {
  std::vector<double> rows;
  rows.reserve(8 * shots.size());
  for (const Shot& shot : shots) {
    const Ray& r = shot.ray;
    for (const double x :
         {r.origin.x, r.origin.y, r.origin.z, r.tnear, r.direction.x, r.direction.y, r.direction.z, r.tfar})
      rows.push_back(x);
  }
  return rows;
}

/// Points into `rows`.
inline RayBatch batch_of(const std::vector<double>& rows) {
  return {std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, {}};
}

}  // namespace gridcast::stability
