#include "core/scene/mesh_hull.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

namespace gridcast::scene {
namespace {

/// Lower and upper end of x, y, z and of the sums that the other ten directions stand for.
struct Reaches {
  static constexpr std::size_t kCount = 13;
  std::array<float, kCount> lower, upper;

  Reaches() {
    lower.fill(std::numeric_limits<float>::infinity());
    upper.fill(-std::numeric_limits<float>::infinity());
  }
  void extend(std::size_t k, float x) {
    lower[k] = std::min(lower[k], x);
    upper[k] = std::max(upper[k], x);
  }
  void extend(const Reaches& other) {
    for (std::size_t k = 0; k < kCount; ++k) {
      lower[k] = std::min(lower[k], other.lower[k]);
      upper[k] = std::max(upper[k], other.upper[k]);
    }
  }
};

/// The direction of each sum above, one of the two opposite ones.
constexpr int kSums[Reaches::kCount][3] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},  {1, 1, 0},  {1, -1, 0},
                                           {0, 1, 1},  {0, 1, -1}, {1, 0, 1},  {1, 0, -1}, {1, 1, 1},
                                           {1, -1, 1}, {1, 1, -1}, {1, -1, -1}};

constexpr std::size_t kPositionsPerTask = 16384;

Reaches reaches_of(const std::vector<Vec3f>& positions) {
  using Range = tbb::blocked_range<std::size_t>;
  return tbb::parallel_reduce(
      Range(0, positions.size(), kPositionsPerTask), Reaches(),
      [&](const Range& range, Reaches reaches) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          const Vec3f& p = positions[i];
          const float sum = p.x + p.y, difference = p.x - p.y;
          const float sums[Reaches::kCount] = {p.x,
                                               p.y,
                                               p.z,
                                               sum,
                                               difference,
                                               p.y + p.z,
                                               p.y - p.z,
                                               p.x + p.z,
                                               p.x - p.z,
                                               sum + p.z,
                                               difference + p.z,
                                               sum - p.z,
                                               difference - p.z};
          for (std::size_t k = 0; k < Reaches::kCount; ++k) reaches.extend(k, sums[k]);
        }
        return reaches;
      },
      [](Reaches a, const Reaches& b) {
        a.extend(b);
        return a;
      });
}

}  // namespace

// The sums of two or three floats above round by at most 2^-24 (2 M + 3 M) < 2^-21 M. Positions that no
// triangle uses count too; where they reach out of the mesh's box, the box limits what they do.
MeshHull::MeshHull(const mesh::TriangleMesh& mesh, const Bounds3f& bounds) {
  if (bounds.empty()) return;
  magnitude_ = bounds.magnitude();
  const Reaches reaches = reaches_of(mesh.positions);
  const float rounding = 0x1p-20F * magnitude_;
  for (std::size_t k = 0; k < Reaches::kCount; ++k) {
    float box_lower = 0.F, box_upper = 0.F;
    int number = 0, weight = 1;
    for (int axis = 0; axis < 3; ++axis, weight *= 3) {
      const int sign = kSums[k][axis];
      number += sign * weight;
      if (sign == 0) continue;
      box_lower += sign > 0 ? bounds.lower[axis] : -bounds.upper[axis];
      box_upper += sign > 0 ? bounds.upper[axis] : -bounds.lower[axis];
    }
    // The axes are exact.
    const float outward = k < 3 ? 0.F : rounding;
    at(number) = std::min(reaches.upper[k], box_upper) + outward;
    at(-number) = -std::max(reaches.lower[k], box_lower) + outward;
  }
  sort_by_signs();
}

void MeshHull::sort_by_signs() {
  for (std::size_t signs = 0; signs < 8; ++signs) {
    const int step[3] = {(signs & 1U) != 0 ? -1 : 1, (signs & 2U) != 0 ? -3 : 3, (signs & 4U) != 0 ? -9 : 9};
    const int corner = step[0] + step[1] + step[2];
    by_signs_.corners[signs] = along(corner);
    for (int axis = 0; axis < 3; ++axis) {
      by_signs_.faces[axis][signs] = along(step[axis]);
      by_signs_.edges[axis][signs] = along(corner - step[axis]);
    }
  }
}

}  // namespace gridcast::scene
