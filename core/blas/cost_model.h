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

/// kAuto takes brute force up to here. Measured on 1 to 64 triangles of a soup, a sphere and a sheet, closest
/// hit, brute force against the wide BVH: n = 2 takes 0.5 to 0.8 of the time, 3 0.8 to 1.1, 4 1.1 to 1.5,
/// 8 1.3 to 1.9, 64 four to six times; four triangles are one block, where a tree is nothing but a build and
/// its memory.
inline constexpr std::size_t kBruteForceTriangles = 4;

/// kAuto also tries a kd-tree when a random ray costs more than this times the cube root of n in the wide
/// BVH, and keeps it when its cost is lower. Through n small triangles that fill their box a ray meets some
/// n^(1/3) (measured costs / n^(1/3): terrain 0.2, sphere 0.4, hair 1.1, soup 2.3); far beyond that boxes
/// overlap, which cells do not. Measured kd-tree / wide BVH, cost and time of closest hits: slivers 0.67,
/// 0.5; needle fan 0.83, 0.65; overlapping soup 1.14, 0.7; hair 1.4, 2.2; sphere 1.6, 1.8. The model is
/// harder on the kd-tree than the clock, which pays for its build and for the packets that only the wide BVH
/// has.
inline constexpr double kOverlapCost = 4.0;

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
