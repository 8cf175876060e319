#pragma once
// Crossings of a ray and a mesh that add up, edges and vertices included: each place where the ray passes the
// surface counts once, however many triangles meet there.

#include "core/math/vec.h"

namespace gridcast::mesh {

/// How the line through `origin` along `direction` crosses the triangle: +1 when it leaves (runs with the
/// normal of the counter-clockwise side), -1 when it enters, 0 when it does not cross. Exact for the numbers
/// as given; corners as doubles that hold floats.
///
/// Where the line passes through an edge or a vertex, the origin is thought to be moved by (e, e^2, e^3) with
/// e > 0 smaller than any number ("Simulation of Simplicity", H. Edelsbrunner, 1990; unlike the paper only
/// the ray is moved, never the mesh). The edge function of p and q,
///   d . ((p - o) x (q - o)) = d . (p x q) + o . ((p - q) x d),
/// then changes by e w.x + e^2 w.y + e^3 w.z with w = (p - q) x d, so that where it is 0 its sign is that of
/// the first component of w that is not 0: a function of the edge and the ray alone, opposite for the
/// triangle on the other side of the edge. The moved line meets no edge that it is not parallel to, so over
/// the triangles of a closed mesh the crossings of the line sum up to 0, and those ahead of the origin to the
/// winding number of the moved origin. A triangle that the line sees as a segment is not crossed: its edge
/// functions sum up to 0, moved or not.
[[nodiscard]] int line_crossing(const Vec3d& origin, const Vec3d& direction, const Vec3d& p0, const Vec3d& p1,
                                const Vec3d& p2);

/// Whether the moved origin lies before the crossing of a triangle that the line crosses as `crossing` says.
/// An origin on the triangle itself is moved off it as above.
[[nodiscard]] bool is_ahead(const Vec3d& origin, const Vec3d& p0, const Vec3d& p1, const Vec3d& p2,
                            int crossing);

/// Whether `point` lies on the closed triangle, exactly. A triangle without area holds no point.
[[nodiscard]] bool lies_on(const Vec3d& point, const Vec3d& p0, const Vec3d& p1, const Vec3d& p2);

}  // namespace gridcast::mesh
