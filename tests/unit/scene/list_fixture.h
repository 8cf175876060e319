#pragma once
// Batches for the tests of lists and counts.

#include <span>
#include <vector>

#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {

inline constexpr blas::StructureKind kKinds[] = {
    blas::StructureKind::kBruteForce, blas::StructureKind::kBvh,        blas::StructureKind::kWideBvh,
    blas::StructureKind::kKdTree,     blas::StructureKind::kCompactBvh, blas::StructureKind::kEmbree};

inline std::vector<double> rows_of(const std::vector<Ray>& rays) {
  std::vector<double> rows;
  for (const Ray& r : rays)
    for (const double x :
         {r.origin.x, r.origin.y, r.origin.z, r.tnear, r.direction.x, r.direction.y, r.direction.z, r.tfar})
      rows.push_back(x);
  return rows;
}

inline RayBatch batch_of(const std::vector<double>& rows) {
  return {std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, {}};
}

}  // namespace gridcast::scene
