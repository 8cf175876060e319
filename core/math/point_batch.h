#pragma once
// Batches of points, and what is answered about them.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include "core/math/ray_batch.h"

namespace gridcast {

/// A view of N points as little-endian row-major [N, 3]. Owns nothing; the bytes need no alignment.
struct PointBatch {
  std::span<const std::byte> bytes;
  ScalarType scalar = ScalarType::kFloat64;

  [[nodiscard]] std::size_t size() const { return bytes.size() / (3 * size_bytes(scalar)); }
  [[nodiscard]] Vec3d operator[](std::size_t i) const {
    if (scalar == ScalarType::kFloat64) {
      Vec3d point;
      std::memcpy(&point, bytes.data() + i * sizeof(point), sizeof(point));
      return point;
    }
    Vec3f point;
    std::memcpy(&point, bytes.data() + i * sizeof(point), sizeof(point));
    return Vec3d(point);
  }
};

/// Finite and within kMaxRayOrigin.
inline bool is_valid_point(const Vec3d& point) {
  return is_finite(point) && max_abs(point) <= kMaxRayOrigin;
}

/// Nearest surface points of N points. Without one: distance +inf, ids kInvalidId, the rest 0.
struct NearestColumns {
  std::vector<RayStatus> status;  ///< [N] kMiss (nothing within the distance), kHit, kInvalid
  std::vector<double> distance;   ///< [N] metres
  std::vector<double> position;   ///< [N, 3] world space
  std::vector<float> uv;          ///< [N, 2]
  std::vector<std::uint32_t> instance_id, mesh_id, primitive_id;  ///< [N]

  void resize(std::size_t n) {
    status.assign(n, RayStatus::kMiss);
    distance.assign(n, std::numeric_limits<double>::infinity());
    position.assign(3 * n, 0.0);
    uv.assign(2 * n, 0.F);
    for (auto* ids : {&instance_id, &mesh_id, &primitive_id}) ids->assign(n, kInvalidId);
  }
};

/// Where a point is; the values are those of the wire format. The first of kOnBoundary, kInside, kUnknown
/// that applies: on a triangle; inside an instance; in the box of an instance that has no inside.
enum class PointPlace : std::uint8_t {
  kOutside = 0,
  kInside = 1,
  kOnBoundary = 2,
  kUnknown = 3,
  kInvalid = 4
};

/// Where N points are. For point i, rows [splits[i], splits[i + 1]) name the instances that it is inside of
/// or on, ascending.
struct InsideColumns {
  std::vector<PointPlace> place;                    ///< [N]
  std::vector<std::uint64_t> splits;                ///< [N + 1]
  std::vector<std::uint32_t> instance_id, mesh_id;  ///< by row
  std::vector<std::int32_t> winding;                ///< by row; 0 on the boundary
  std::vector<std::uint8_t> on_boundary;            ///< by row; 0 or 1
  std::vector<std::uint32_t> open_meshes;           ///< met in the box of an instance; ascending
};

}  // namespace gridcast
