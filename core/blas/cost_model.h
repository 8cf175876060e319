#pragma once
// The surface-area cost model that builders, refits and the choice of a structure share.
// "Heuristics for ray tracing using space subdivision", J. D. MacDonald, 1990: a random ray that meets a
// convex box meets a box inside it with the ratio of their surface areas as probability.

#include <cstddef>

#include "core/math/bounds.h"

namespace gridcast::blas {

/// The unit of every cost: one triangle test.
inline constexpr double kTriangleCost = 1.0;
/// One step through an inner node: two box tests, the wait for the pair's cache line, and a branch that is
/// hard to predict, while most triangle tests end at the first signs. Measured on a sphere of 327,680
/// triangles: of 0.6, 1 and 2 the last gave the fastest rays, the fastest build and the smallest tree.
inline constexpr double kNodeCost = 2.0;

/// One step to a node of eight children, and one block of four triangles with the one in a few that needs
/// the test in double.
inline constexpr double kWideNodeCost = 2.0;
inline constexpr double kBlockCost = 0.8;

/// kAuto takes brute force up to here. The best tree over n triangles still costs one node, and as the boxes
/// of both halves of a surface cover most of the whole, some 0.7 n tests: 2 + 5.6 against 8. There is nothing
/// to win that would pay for a build, a refit and a second allocation.
inline constexpr std::size_t kBruteForceTriangles = 8;

/// How likely a ray that meets `root` meets `box` inside it. In double, because the squares of small floats
/// underflow; roots without area compare lengths, points compare as equal.
inline double hit_probability(const Bounds3f& box, const Bounds3f& root) {
  if (box.empty()) return 0.0;
  const double root_area = to_double(root).half_area();
  if (root_area > 0.0) return to_double(box).half_area() / root_area;
  const Vec3d extent = to_double(root).extent();
  const double length = extent.x + extent.y + extent.z;
  if (!(length > 0.0)) return 1.0;
  const Vec3d inner = to_double(box).extent();
  return (inner.x + inner.y + inner.z) / length;
}

}  // namespace gridcast::blas
