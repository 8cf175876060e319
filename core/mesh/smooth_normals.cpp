#include "core/mesh/half_edges.h"
#include "core/mesh/topology.h"
#include "core/mesh/weld.h"

namespace gridcast::mesh {

std::vector<Vec3f> smooth_normals(const TriangleMesh& mesh) {
  const std::vector<std::uint32_t> welded = weld_vertices(mesh);
  const HalfEdges half_edges = build_half_edges(mesh, welded);

  // Every sector of every face adds its face's normal, times its angle, to the place it stands at.
  std::vector<Vec3d> sums(mesh.positions.size(), Vec3d(0.0));
  for (const auto face : half_edges.mesh.faces()) {
    const auto n = half_edges.mesh.calc_face_normal(face);
    for (const auto into : half_edges.mesh.fh_range(face)) {
      const double angle = half_edges.mesh.calc_sector_angle(into);
      const auto vertex = std::size_t(half_edges.mesh.to_vertex_handle(into).idx());
      sums[half_edges.origin[vertex]] += angle * Vec3d(n[0], n[1], n[2]);
    }
  }

  std::vector<Vec3f> normals(mesh.positions.size());
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Vec3d& sum = sums[welded[i]];
    const double length = glm::length(sum);
    normals[i] = length > 0.0 ? Vec3f(sum / length) : Vec3f(0.F, 0.F, 1.F);
  }
  return normals;
}

}  // namespace gridcast::mesh
