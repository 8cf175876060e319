#pragma once
// Triangles, placements and rays that numbers of limited precision get wrong: RC09, RC12, RC15, RC16, RC22,
// RC23, RC35 of the failure modes.

#include <array>
#include <cmath>

#include "core/math/affine.h"
#include "core/math/ray.h"
#include "tests/support/random.h"

namespace gridcast::test {

/// One triangle of one instance; the transform is active.
struct HostileTriangle {
  std::array<Vec3f, 3> corners;
  InstanceTransform transform;

  /// The world point of barycentric coordinates, rounded.
  [[nodiscard]] Vec3d point(double u, double v) const;
};

/// Coordinates over sixteen powers of ten; slivers of 1e1 to 1e8 : 1; offsets up to 1e12 in the floats of the
/// mesh or in the transform; scales of 1e-6 to 1e6, mirrored, sheared, flattened to a condition of 1e10.
[[nodiscard]] HostileTriangle hostile_triangle(Random& random);

/// Aimed at the triangle, at an edge or at a corner, from 1e-6 to 1e6 of its size away; a third of them at
/// grazing angles of 1e-1 to 1e-9 rad; directions of any length from 1e-6 to 1e6.
[[nodiscard]] Ray hostile_ray(const HostileTriangle& triangle, Random& random);

}  // namespace gridcast::test
