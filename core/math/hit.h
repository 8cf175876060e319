#pragma once

#include <cstdint>
#include <limits>

#include "core/math/ray.h"

namespace gridcast {

/// The closest hit found so far, and the tie rule. (u, v): p = (1-u-v) p0 + u p1 + v p2.
/// Starts as {tfar, no ids}: a hit at exactly tfar is still accepted, because every id is smaller
/// than kInvalidId.
struct Hit {
  double t = std::numeric_limits<double>::infinity();
  double u = 0.0;
  double v = 0.0;
  std::uint32_t instance_id = kInvalidId;
  std::uint32_t primitive_id = kInvalidId;
  /// Where the tree that found the hit keeps the triangle's corners, which Blas::corners understands: they
  /// are in the cache, where those of the mesh are two misses away. kInvalidId: the mesh knows.
  std::uint32_t corners_at = kInvalidId;

  [[nodiscard]] bool valid() const { return primitive_id != kInvalidId; }
};

/// Smaller t wins; at the same t the smaller (instance_id, primitive_id).
inline bool closer(const Hit& a, const Hit& b) {
  if (a.t != b.t) return a.t < b.t;
  if (a.instance_id != b.instance_id) return a.instance_id < b.instance_id;
  return a.primitive_id < b.primitive_id;
}

/// A hit as a caller sees it: in world space, with the mesh and the geometric normal.
struct SurfaceHit {
  RayStatus status = RayStatus::kMiss;
  double t = std::numeric_limits<double>::infinity();
  double u = 0.0;
  double v = 0.0;
  Vec3d normal{0.0};  ///< unit, world space, on the side of counter-clockwise winding in object space
  std::uint32_t instance_id = kInvalidId;
  std::uint32_t mesh_id = kInvalidId;
  std::uint32_t primitive_id = kInvalidId;
  /// Certified bound of |t - exact t| (core/scene/hit_error.h); +infinity where none was asked for.
  double t_error = std::numeric_limits<double>::infinity();
};

}  // namespace gridcast
