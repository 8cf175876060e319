#include "core/mesh/triangle_mesh.h"

#include <algorithm>

namespace gridcast::mesh {
namespace {

Error invalid(std::string message, std::string where) {
  return {ErrorCode::kInvalidArgument, std::move(message), std::move(where)};
}

Status validate_parts(const TriangleMesh& mesh) {
  std::size_t next = 0;
  for (std::size_t i = 0; i < mesh.parts.size(); ++i) {
    if (mesh.parts[i].first_triangle != next) {
      return invalid("the part does not start where the one before it ends", "/parts/" + std::to_string(i));
    }
    next += mesh.parts[i].triangle_count;
  }
  if (!mesh.parts.empty() && next != mesh.triangles.size())
    return invalid("the parts do not cover the triangles", "/parts");
  return ok_status();
}

}  // namespace

Bounds3f TriangleMesh::triangle_bounds(std::uint32_t primitive_id) const {
  Bounds3f box;
  for (const Vec3f& p : corners(primitive_id)) box.extend(p);
  return box;
}

Bounds3f TriangleMesh::bounds() const {
  Bounds3f box;
  for (const Triangle& t : triangles)
    for (const std::uint32_t vertex : t) box.extend(positions[vertex]);
  return box;
}

std::uint32_t TriangleMesh::part_of(std::uint32_t primitive_id) const {
  const auto after =
      std::upper_bound(parts.begin(), parts.end(), primitive_id,
                       [](std::uint32_t id, const MeshPart& part) { return id < part.first_triangle; });
  return after == parts.begin() ? 0U : std::uint32_t(after - parts.begin()) - 1U;
}

std::size_t TriangleMesh::memory_bytes() const {
  return positions.capacity() * sizeof(Vec3f) + triangles.size() * sizeof(Triangle) +
         normals.capacity() * sizeof(Vec3f) + parts.capacity() * sizeof(MeshPart);
}

Status validate_positions(std::span<const Vec3f> positions) {
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (is_finite(positions[i]) && max_abs(positions[i]) <= kMaxCoordinate) continue;
    return invalid("a position is not finite or larger than 1e18", "/positions/" + std::to_string(i));
  }
  return ok_status();
}

Status validate(const TriangleMesh& mesh) {
  if (Status status = validate_positions(mesh.positions); !status) return status;
  if (mesh.triangles.size() >= kInvalidId) return invalid("more than 2^32 - 2 triangles", "/triangles");
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (const std::uint32_t vertex : mesh.triangles[i]) {
      if (vertex < mesh.positions.size()) continue;
      return invalid("vertex index " + std::to_string(vertex) + " is out of range: the mesh has " +
                         std::to_string(mesh.positions.size()) + " vertices",
                     "/triangles/" + std::to_string(i));
    }
  }
  if (!mesh.normals.empty() && mesh.normals.size() != mesh.positions.size()) {
    return invalid("there must be one normal per position, or none", "/normals");
  }
  return validate_parts(mesh);
}

}  // namespace gridcast::mesh
