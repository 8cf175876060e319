#include "core/mesh/half_edges.h"

#include <mutex>

namespace gridcast::mesh {
namespace {

// OpenMesh finds the half-edge between two vertices by walking around one of them. Beyond this many faces
// at a vertex attaching would cost their square (a fan of a million triangles), so they stand alone.
constexpr std::uint32_t kMaxValence = 256;

OpenMesh::VertexHandle add_vertex(HalfEdges& half_edges, const TriangleMesh& mesh, std::uint32_t vertex) {
  const Vec3d p(mesh.positions[vertex]);
  half_edges.origin.push_back(vertex);
  return half_edges.mesh.add_vertex({p.x, p.y, p.z});
}

// The conditions under which OpenMesh would refuse: a vertex that is surrounded already, or an edge that
// has a face on this side already.
bool can_attach(const OpenTriMesh& mesh, const std::array<OpenMesh::VertexHandle, 3>& corners) {
  for (int i = 0; i < 3; ++i) {
    const auto from = corners[std::size_t(i)], to = corners[std::size_t((i + 1) % 3)];
    if (!mesh.is_boundary(from)) return false;
    const auto half_edge = mesh.find_halfedge(from, to);
    if (half_edge.is_valid() && !mesh.is_boundary(half_edge)) return false;
  }
  return true;
}

std::vector<std::uint32_t> count_valences(const TriangleMesh& mesh,
                                          const std::vector<std::uint32_t>& welded) {
  std::vector<std::uint32_t> valence(mesh.positions.size(), 0);
  for (const Triangle& triangle : mesh.triangles)
    for (const std::uint32_t vertex : triangle) ++valence[welded[vertex]];
  return valence;
}

// A rare relinking failure inside OpenMesh is reported by value (handled below) and on stderr, where a
// library has nothing to say.
void silence_open_mesh() {
  static std::once_flag once;
  std::call_once(once, [] { omerr().disable(); });
}

}  // namespace

HalfEdges build_half_edges(const TriangleMesh& mesh, const std::vector<std::uint32_t>& welded) {
  silence_open_mesh();
  const std::vector<std::uint32_t> valence = count_valences(mesh, welded);
  HalfEdges result;
  std::vector<OpenMesh::VertexHandle> handle(mesh.positions.size());
  std::vector<Triangle> alone;
  for (const Triangle& triangle : mesh.triangles) {
    const Triangle t{welded[triangle[0]], welded[triangle[1]], welded[triangle[2]]};
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    std::array<OpenMesh::VertexHandle, 3> corners;
    bool attached = true;
    for (std::size_t i = 0; i < 3; ++i) {
      if (!handle[t[i]].is_valid()) handle[t[i]] = add_vertex(result, mesh, t[i]);
      corners[i] = handle[t[i]];
      attached = attached && valence[t[i]] <= kMaxValence;
    }
    attached = attached && can_attach(result.mesh, corners) &&
               result.mesh.add_face(corners[0], corners[1], corners[2]).is_valid();
    if (!attached) alone.push_back(t);
  }

  result.attached_faces = result.mesh.n_faces();
  for (const Triangle& t : alone) {
    const auto a = add_vertex(result, mesh, t[0]), b = add_vertex(result, mesh, t[1]),
               c = add_vertex(result, mesh, t[2]);
    result.mesh.add_face(a, b, c);
  }
  return result;
}

}  // namespace gridcast::mesh
