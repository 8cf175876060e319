#pragma once
// Closed meshes in the world, points inside of them, and rays from there to their edges and vertices.

#include <vector>

#include "core/math/affine.h"
#include "core/math/ray.h"
#include "core/mesh/triangle_mesh.h"
#include "tests/support/random.h"

namespace gridcast::test {

/// How often the surface winds around `p`: the sum of the signed solid angles of its triangles over 4 pi,
/// "The solid angle of a plane triangle", A. van Oosterom, 1983. An integer up to rounding for a closed mesh.
[[nodiscard]] double winding_number(const mesh::TriangleMesh& mesh, const Vec3d& p);

enum class Aim { kEdge, kVertex };

/// A closed mesh moved by (offset, -offset, offset), and points of the world that are inside.
class ClosedPlacement {
 public:
  ClosedPlacement(const mesh::TriangleMesh& mesh, double offset, std::uint64_t seed);
  /// False when no point inside was found: the doubles there cannot tell the mesh's points apart.
  [[nodiscard]] bool usable() const { return !origins_.empty(); }
  [[nodiscard]] const Affine& world_from_object() const { return transform_.world_from_object(); }

  /// From inside to an edge or a vertex.
  [[nodiscard]] Ray world_ray(Aim aim, Random& random) const;
  /// The same as an instance gets it.
  [[nodiscard]] Ray object_ray(Aim aim, Random& random) const;

 private:
  const mesh::TriangleMesh& mesh_;
  InstanceTransform transform_;
  std::vector<Vec3d> origins_;
};

}  // namespace gridcast::test
