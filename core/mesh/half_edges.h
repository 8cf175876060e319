#pragma once

#include <cstdint>
#include <vector>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include "core/mesh/triangle_mesh.h"

namespace gridcast::mesh {

/// Doubles, so that angles and normals of slivers are as good as the float positions allow.
struct HalfEdgeTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using OpenTriMesh = OpenMesh::TriMesh_ArrayKernelT<HalfEdgeTraits>;

/// A mesh as half-edges. OpenMesh holds oriented manifolds only: a face it cannot attach (a third face at an
/// edge, a turned one, a second fan at a vertex) stands alone on vertices of its own, so every face with
/// three distinct positions is here.
struct HalfEdges {
  OpenTriMesh mesh;
  std::vector<std::uint32_t> origin;  ///< vertex of `mesh` -> welded vertex of the triangle mesh
  std::size_t attached_faces = 0;     ///< the first faces of `mesh`; those after them stand alone
};

/// `welded` comes from weld_vertices.
[[nodiscard]] HalfEdges build_half_edges(const TriangleMesh& mesh, const std::vector<std::uint32_t>& welded);

}  // namespace gridcast::mesh
