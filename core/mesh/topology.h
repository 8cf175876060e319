#pragma once

#include <cstddef>
#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace gridcast::mesh {

/// How the triangles of a mesh hang together, vertices at exactly equal positions counted as one.
/// Faces with fewer than three distinct vertices count as degenerate and have no edges here.
struct TopologyReport {
  std::size_t vertex_count = 0;  ///< distinct positions used
  std::size_t edge_count = 0;
  std::size_t boundary_edges = 0;      ///< edges of one face
  std::size_t non_manifold_edges = 0;  ///< edges of more than two faces
  std::size_t inconsistent_edges = 0;  ///< edges of two faces that run the same way along them
  std::size_t degenerate_faces = 0;    ///< exactly zero area, repeated vertices included
  std::size_t components = 0;          ///< connected by shared edges
  std::size_t holes = 0;  ///< closed loops of boundary edges; 0 unless the mesh is an oriented manifold
  bool closed =
      false;  ///< no boundary and no non-manifold edge, at least one face: a ray from inside cannot leave
};

/// Counts only; the mesh that is cast keeps every face whatever the report says.
[[nodiscard]] TopologyReport analyse_topology(const TriangleMesh& mesh);

/// Whether the mesh has an inside: along every edge as many faces run one way as the other, vertices at
/// exactly equal positions counted as one. Then every point off the surface has a winding number. Stricter
/// than `closed` about the orientation, laxer about edges of four or more faces.
[[nodiscard]] bool has_inside(const TriangleMesh& mesh);

/// Unit vertex normals, angle-weighted over the faces around each vertex, one per position; vertices
/// without a face with area get {0, 0, 1}. Vertices at equal positions are smoothed together.
[[nodiscard]] std::vector<Vec3f> smooth_normals(const TriangleMesh& mesh);

}  // namespace gridcast::mesh
