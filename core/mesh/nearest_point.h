#pragma once
// The point of a triangle that is nearest to the origin of its coordinates.

#include <cmath>

#include "core/math/vec.h"

namespace gridcast::mesh {

struct NearestPoint {
  double distance;
  double u, v;  ///< p = (1-u-v) p0 + u p1 + v p2
  Vec3d point;
};

/// Corners relative to the point asked about. The nearest of four candidates, one on each edge and one
/// inside: each is a point of the triangle whatever its shape, so slivers and triangles without area lose
/// accuracy in no worse way than the edges do. Neighbours give the same bits for a shared edge or vertex.
[[nodiscard]] NearestPoint nearest_to_origin(const Vec3d& p0, const Vec3d& p1, const Vec3d& p2);

}  // namespace gridcast::mesh
