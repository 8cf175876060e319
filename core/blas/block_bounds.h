#pragma once
// Filling triangle blocks and drawing boxes around them, four triangles at a time.

#include <array>

#include "core/blas/float4.h"
#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

/// Bounds per lane, axis by axis: joined over several blocks before the lanes are.
struct LaneBounds {
  std::array<Float4, 3> lower;
  std::array<Float4, 3> upper;

  LaneBounds() {
    lower.fill(Box4{}.lower);
    upper.fill(Box4{}.upper);
  }
  /// + 0: minimum and maximum of -0 and +0 would depend on their order.
  void extend(const TriangleBlock& block) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const auto& corner : block.corners) {
        Float4 lanes;
        __builtin_memcpy(&lanes, corner[axis], sizeof(lanes));
        lanes += broadcast(0.F);
        lower[axis] = min(lanes, lower[axis]);
        upper[axis] = max(lanes, upper[axis]);
      }
    }
  }
  [[nodiscard]] Bounds3f bounds() const {
    Bounds3f box;
    for (int axis = 0; axis < 3; ++axis) {
      const Float4 l = lower[std::size_t(axis)], u = upper[std::size_t(axis)];
      box.lower[axis] = std::min(std::min(l[0], l[1]), std::min(l[2], l[3]));
      box.upper[axis] = std::max(std::max(u[0], u[1]), std::max(u[2], u[3]));
    }
    return box;
  }
};

/// The corners of the triangles that the block names.
inline void load_corners(const mesh::Triangle* triangles, const Vec3f* positions, TriangleBlock& block) {
  for (int lane = 0; lane < 4; ++lane) {
    const mesh::Triangle& triangle = triangles[block.ids[lane]];
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const Vec3f& p = positions[triangle[corner]];
      for (int axis = 0; axis < 3; ++axis) block.corners[corner][axis][lane] = p[axis];
    }
  }
}
inline void load_corners(const mesh::TriangleMesh& mesh, TriangleBlock& block) {
  load_corners(mesh.triangles.data(), mesh.positions.data(), block);
}

}  // namespace gridcast::blas
