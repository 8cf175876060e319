#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/math/bounds.h"
#include "core/math/shared_vector.h"

namespace gridcast::mesh {

using Triangle = std::array<std::uint32_t, 3>;

/// Largest accepted absolute coordinate; products of three differences then stay far inside double.
inline constexpr float kMaxCoordinate = 1e18F;

/// Triangles [first_triangle, first_triangle + triangle_count) share a material (kInvalidId = the default
/// one). One glTF primitive is one part.
struct MeshPart {
  std::uint32_t first_triangle = 0;
  std::uint32_t triangle_count = 0;
  std::uint32_t material_id = kInvalidId;
};

/// An indexed triangle mesh in object space. Immutable once shared; a changed mesh is a new value
/// with a higher version. primitive_id = index into `triangles`, in the file's order.
struct TriangleMesh {
  std::string name;
  std::vector<Vec3f> positions;
  SharedVector<Triangle> triangles;  ///< versions of a mesh that moves share them
  std::vector<Vec3f> normals;        ///< per vertex, unit, for shading only; empty = none
  std::vector<MeshPart> parts;       ///< cover `triangles` in order; empty = one part of the default material
  std::uint32_t topology_version = 0;  ///< changes with `triangles` or the number of positions
  std::uint32_t vertex_version = 0;    ///< changes with the values of `positions`

  [[nodiscard]] std::size_t triangle_count() const { return triangles.size(); }
  [[nodiscard]] std::array<Vec3f, 3> corners(std::uint32_t primitive_id) const {
    const Triangle& t = triangles[primitive_id];
    return {positions[t[0]], positions[t[1]], positions[t[2]]};
  }
  [[nodiscard]] Bounds3f triangle_bounds(std::uint32_t primitive_id) const;
  /// Box of every vertex that a triangle uses; unused vertices do not count.
  [[nodiscard]] Bounds3f bounds() const;
  /// Index into `parts` of a triangle; 0 when there are none.
  [[nodiscard]] std::uint32_t part_of(std::uint32_t primitive_id) const;
  [[nodiscard]] std::size_t memory_bytes() const;
};

/// Finite positions within kMaxCoordinate, indices in range, parts that cover the triangles, at most
/// 2^32 - 2 triangles. The error names the first offending element (`/positions/17`, `/triangles/3`).
[[nodiscard]] Status validate(const TriangleMesh& mesh);

/// Finite and within kMaxCoordinate; the error names the first offending one (`/positions/17`).
[[nodiscard]] Status validate_positions(std::span<const Vec3f> positions);

}  // namespace gridcast::mesh
