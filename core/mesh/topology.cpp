#include "core/mesh/topology.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/math/exact.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/weld.h"

namespace gridcast::mesh {
namespace {

// One side of one face, keyed by its undirected edge: sorting puts all faces of an edge together, however
// many there are, which half-edges cannot hold.
struct Side {
  std::uint64_t edge;  // smaller welded vertex in the upper half
  std::uint32_t face;
  bool forward;  // runs from the smaller to the larger vertex
};

bool has_area(const std::array<Vec3f, 3>& p) {
  // Far from 0 the rounded cross product decides; its error is below 2^-50 of the edges' product.
  const Vec3d e1 = Vec3d(p[1]) - Vec3d(p[0]), e2 = Vec3d(p[2]) - Vec3d(p[0]);
  if (max_abs(glm::cross(e1, e2)) > 0x1p-48 * max_abs(e1) * max_abs(e2)) return true;
  const Vec3d a(p[0]), b(p[1]), c(p[2]);
  return exact_side({1.0, 0.0, 0.0}, a, b, c) != 0.0 || exact_side({0.0, 1.0, 0.0}, a, b, c) != 0.0 ||
         exact_side({0.0, 0.0, 1.0}, a, b, c) != 0.0;
}

/// Disjoint sets of faces; only faces with edges are counted.
class Components {
 public:
  explicit Components(std::size_t faces) : parent_(faces) {
    std::iota(parent_.begin(), parent_.end(), std::uint32_t(0));
  }
  /// True when the two were apart before.
  bool join(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    if (a == b) return false;
    parent_[std::max(a, b)] = std::min(a, b);
    return true;
  }

 private:
  std::uint32_t find(std::uint32_t face) {
    while (parent_[face] != face) face = parent_[face] = parent_[parent_[face]];
    return face;
  }
  std::vector<std::uint32_t> parent_;
};

std::vector<Side> collect_sides(const TriangleMesh& mesh, const std::vector<std::uint32_t>& welded) {
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (std::uint32_t face = 0; face < mesh.triangles.size(); ++face) {
    const Triangle& t = mesh.triangles[face];
    const Triangle w{welded[t[0]], welded[t[1]], welded[t[2]]};
    if (w[0] == w[1] || w[1] == w[2] || w[2] == w[0]) continue;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(w[i], w[(i + 1) % 3]);
      sides.push_back({std::uint64_t(low) << 32U | high, face, w[i] == low});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return a.edge < b.edge; });
  return sides;
}

void count_edges(const std::vector<Side>& sides, std::size_t face_count, TopologyReport& report) {
  Components components(face_count);
  report.components = sides.size() / 3;
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t last = first + 1;
    while (last < sides.size() && sides[last].edge == sides[first].edge) {
      if (components.join(sides[first].face, sides[last].face)) --report.components;
      ++last;
    }
    const std::size_t faces = last - first;
    ++report.edge_count;
    if (faces == 1) ++report.boundary_edges;
    if (faces > 2) ++report.non_manifold_edges;
    if (faces == 2 && sides[first].forward == sides[first + 1].forward) ++report.inconsistent_edges;
    first = last;
  }
}

std::size_t count_used(const TriangleMesh& mesh, const std::vector<std::uint32_t>& welded) {
  std::vector<bool> used(mesh.positions.size(), false);
  for (const Triangle& triangle : mesh.triangles)
    for (const std::uint32_t vertex : triangle) used[welded[vertex]] = true;
  return std::size_t(std::count(used.begin(), used.end(), true));
}

// Follows every boundary half-edge once around its hole. Where fans of faces meet in one vertex, some face
// stands alone and its own rim is no hole: no figure then.
std::size_t count_holes(const TriangleMesh& mesh, const std::vector<std::uint32_t>& welded) {
  const HalfEdges half_edges = build_half_edges(mesh, welded);
  const OpenTriMesh& open = half_edges.mesh;
  if (half_edges.attached_faces != open.n_faces()) return 0;
  std::vector<bool> seen(open.n_halfedges(), false);
  std::size_t holes = 0;
  for (const auto start : open.halfedges()) {
    if (!open.is_boundary(start) || seen[std::size_t(start.idx())]) continue;
    ++holes;
    OpenMesh::HalfedgeHandle at = start;
    do {
      seen[std::size_t(at.idx())] = true;
      at = open.next_halfedge_handle(at);
    } while (at != start);
  }
  return holes;
}

}  // namespace

TopologyReport analyse_topology(const TriangleMesh& mesh) {
  TopologyReport report;
  const std::vector<std::uint32_t> welded = weld_vertices(mesh);
  report.vertex_count = count_used(mesh, welded);
  for (std::uint32_t face = 0; face < mesh.triangles.size(); ++face)
    if (!has_area(mesh.corners(face))) ++report.degenerate_faces;
  {
    const std::vector<Side> sides = collect_sides(mesh, welded);
    count_edges(sides, mesh.triangles.size(), report);
  }
  report.closed = report.edge_count > 0 && report.boundary_edges == 0 && report.non_manifold_edges == 0;
  const bool oriented_manifold = report.non_manifold_edges == 0 && report.inconsistent_edges == 0;
  if (oriented_manifold && report.boundary_edges > 0) report.holes = count_holes(mesh, welded);
  return report;
}

bool has_inside(const TriangleMesh& mesh) {
  const std::vector<Side> sides = collect_sides(mesh, weld_vertices(mesh));
  for (std::size_t first = 0; first < sides.size();) {
    std::ptrdiff_t balance = 0;
    std::size_t last = first;
    for (; last < sides.size() && sides[last].edge == sides[first].edge; ++last)
      balance += sides[last].forward ? 1 : -1;
    if (balance != 0) return false;
    first = last;
  }
  return !sides.empty();
}

}  // namespace gridcast::mesh
