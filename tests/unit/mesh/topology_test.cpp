#include "core/mesh/topology.h"

#include <gtest/gtest.h>

#include "core/mesh/half_edges.h"
#include "core/mesh/weld.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::mesh {
namespace {

// Every triangle gets three vertices of its own, as an STL file would have them.
TriangleMesh exploded(const TriangleMesh& mesh) {
  TriangleMesh result;
  for (std::uint32_t i = 0; i < mesh.triangle_count(); ++i) {
    const auto first = std::uint32_t(result.positions.size());
    for (const Vec3f& p : mesh.corners(i)) result.positions.push_back(p);
    result.triangles.push_back({first, first + 1, first + 2});
  }
  return result;
}

TriangleMesh joined(TriangleMesh a, const TriangleMesh& b) {
  const auto offset = std::uint32_t(a.positions.size());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  for (const Triangle& t : b.triangles) a.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  return a;
}

// Three triangles that share the edge from (0,0,0) to (0,0,1).
TriangleMesh three_page_book() {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {-1, 1, 0}, {-1, -1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 1, 3}, {1, 0, 4}};
  return mesh;
}

TEST(Topology, a_box_is_closed_with_eighteen_edges) {
  const TopologyReport report = analyse_topology(test::box({0, 0, 0}, {1, 2, 3}));
  EXPECT_EQ(report.vertex_count, 8U);
  EXPECT_EQ(report.edge_count, 18U);
  EXPECT_EQ(report.boundary_edges, 0U);
  EXPECT_EQ(report.inconsistent_edges, 0U);
  EXPECT_EQ(report.components, 1U);
  EXPECT_TRUE(report.closed);
}

TEST(Topology, vertices_at_equal_positions_count_as_one_even_with_signed_zeros) {
  TriangleMesh mesh = exploded(test::box({0, 0, 0}, {1, 1, 1}));
  mesh.positions[0].x = -0.F;
  const TopologyReport report = analyse_topology(mesh);
  EXPECT_EQ(report.vertex_count, 8U);
  EXPECT_TRUE(report.closed);
}

TEST(Topology, unused_vertices_are_not_counted) {
  TriangleMesh mesh = test::single_triangle();
  mesh.positions.push_back({9, 9, 9});
  EXPECT_EQ(analyse_topology(mesh).vertex_count, 3U);
}

TEST(Topology, a_flat_grid_has_its_rim_as_boundary_and_one_hole) {
  const TopologyReport report = analyse_topology(test::quad_grid(64));
  EXPECT_EQ(report.boundary_edges, 256U);
  EXPECT_EQ(report.holes, 1U);
  EXPECT_FALSE(report.closed);
}

TEST(Topology, a_sphere_with_two_faces_missing_has_two_holes) {
  TriangleMesh mesh = test::icosphere(2);
  for (const std::size_t missing : {200U, 0U}) {
    mesh.triangles[missing] = mesh.triangles.back();
    mesh.triangles.pop_back();
  }
  const TopologyReport report = analyse_topology(mesh);
  EXPECT_EQ(report.boundary_edges, 6U);
  EXPECT_EQ(report.holes, 2U);
  EXPECT_EQ(report.components, 1U);
}

TEST(Topology, an_edge_of_three_faces_is_non_manifold_and_all_three_are_counted) {
  const TopologyReport report = analyse_topology(three_page_book());
  EXPECT_EQ(report.edge_count, 7U);
  EXPECT_EQ(report.non_manifold_edges, 1U);
  EXPECT_EQ(report.boundary_edges, 6U);
  EXPECT_EQ(report.components, 1U);
}

TEST(Topology, a_turned_face_makes_its_three_edges_inconsistent) {
  TriangleMesh mesh = test::icosphere(1);
  std::swap(mesh.triangles[7][0], mesh.triangles[7][1]);
  const TopologyReport report = analyse_topology(mesh);
  EXPECT_EQ(report.inconsistent_edges, 3U);
  EXPECT_TRUE(report.closed);
}

TEST(Topology, copies_of_a_closed_mesh_make_every_edge_non_manifold) {
  const TriangleMesh sphere = test::icosphere(2);
  const TopologyReport report = analyse_topology(test::repeated(sphere, 3));
  EXPECT_EQ(report.non_manifold_edges, 3 * sphere.triangle_count() / 2);
  EXPECT_EQ(report.edge_count, report.non_manifold_edges);
}

TEST(Topology, exactly_flat_triangles_are_degenerate_and_slivers_are_not) {
  TriangleMesh mesh = test::slivers(100, 7, 1e6F);
  EXPECT_EQ(analyse_topology(mesh).degenerate_faces, 0U);
  const auto first = std::uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {{0.1F, 0.1F, 0.1F}, {0.2F, 0.2F, 0.2F}, {0.4F, 0.4F, 0.4F}});
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first, first + 1});
  mesh.triangles.push_back({first, first, first});
  const TopologyReport report = analyse_topology(mesh);
  EXPECT_EQ(report.degenerate_faces, 3U);
  EXPECT_EQ(report.edge_count, 303U);  // repeated vertices leave no edge, the collinear face has three
}

TEST(Topology, one_ulp_beside_a_line_has_area) {
  TriangleMesh mesh;
  const float above = std::nextafter(4194304.F, 1e9F);
  mesh.positions = {{1, 1, 0}, {8388608, 8388608, 0}, {4194304, above, 0}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_EQ(analyse_topology(mesh).degenerate_faces, 0U);
}

TEST(Topology, separate_bodies_are_separate_components) {
  const TriangleMesh mesh = joined(test::icosphere(1), test::translated(test::torus(8, 6), {5, 0, 0}));
  EXPECT_EQ(analyse_topology(mesh).components, 2U);
  EXPECT_EQ(analyse_topology(test::soup(50, 3)).components, 50U);
}

TEST(Topology, bodies_that_touch_in_a_vertex_stay_two_components_and_closed) {
  const TopologyReport report =
      analyse_topology(joined(test::box({0, 0, 0}, {1, 1, 1}), test::box({1, 1, 1}, {2, 2, 2})));
  EXPECT_EQ(report.components, 2U);
  EXPECT_EQ(report.vertex_count, 15U);
  EXPECT_TRUE(report.closed);
}

TEST(Topology, an_empty_mesh_is_not_closed) {
  const TopologyReport report = analyse_topology(TriangleMesh{});
  EXPECT_FALSE(report.closed);
  EXPECT_EQ(report.components, 0U);
}

TEST(HalfEdges, faces_that_do_not_attach_are_kept_alone) {
  for (const TriangleMesh& mesh :
       {three_page_book(), test::repeated(test::icosphere(1), 3),
        joined(test::box({0, 0, 0}, {1, 1, 1}), test::box({1, 1, 1}, {2, 2, 2}))}) {
    const HalfEdges half_edges = build_half_edges(mesh, weld_vertices(mesh));
    EXPECT_EQ(half_edges.mesh.n_faces(), mesh.triangle_count());
    EXPECT_LT(half_edges.attached_faces, mesh.triangle_count());
  }
}

TEST(HalfEdges, counts_agree_with_the_report_on_random_parts_of_manifold_meshes) {
  test::Random random(test::seed_or(11));
  for (int round = 0; round < 20; ++round) {
    TriangleMesh mesh = test::torus(12, 9);
    std::vector<Triangle> left;
    for (const Triangle& triangle : std::as_const(mesh.triangles))
      if (random.below(4) != 0) left.push_back(triangle);
    mesh.triangles = std::move(left);
    const HalfEdges half_edges = build_half_edges(mesh, weld_vertices(mesh));
    const TopologyReport report = analyse_topology(mesh);
    std::size_t boundary = 0;
    for (const auto edge : half_edges.mesh.edges())
      if (half_edges.mesh.is_boundary(edge)) ++boundary;
    // A vertex with two gaps may make a face stand alone; its edges then count once more.
    const std::size_t alone = half_edges.mesh.n_faces() - half_edges.attached_faces;
    EXPECT_GE(boundary, report.boundary_edges);
    EXPECT_LE(boundary, report.boundary_edges + 6 * alone);
  }
}

TEST(SmoothNormals, of_a_sphere_point_outward) {
  const TriangleMesh mesh = test::icosphere(4);
  const std::vector<Vec3f> normals = smooth_normals(mesh);
  ASSERT_EQ(normals.size(), mesh.positions.size());
  for (std::size_t i = 0; i < normals.size(); ++i)
    EXPECT_LT(glm::distance(normals[i], mesh.positions[i]), 0.002F) << i;
}

TEST(SmoothNormals, of_a_box_lie_on_the_diagonals_because_angles_weigh_not_triangles) {
  const std::vector<Vec3f> normals = smooth_normals(test::box({-1, -1, -1}, {1, 1, 1}));
  for (const Vec3f& n : normals)
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(std::abs(n[axis]), 0.57735027F, 1e-6F);
}

TEST(SmoothNormals, are_the_same_with_and_without_shared_vertices) {
  const TriangleMesh mesh = test::jittered_icosphere(2, 5);
  const TriangleMesh apart = exploded(mesh);
  const std::vector<Vec3f> shared_normals = smooth_normals(mesh), apart_normals = smooth_normals(apart);
  for (std::size_t i = 0; i < mesh.triangle_count(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_LT(glm::distance(apart_normals[3 * i + k], shared_normals[mesh.triangles[i][k]]), 1e-6F);
}

TEST(SmoothNormals, faces_that_do_not_attach_still_contribute) {
  const std::vector<Vec3f> normals = smooth_normals(three_page_book());
  // Page 2, (0,1,3), is the one half-edges refuse: its free vertex still gets its face's normal.
  const Vec3f expected = glm::normalize(glm::cross(Vec3f(0, 0, 1), Vec3f(-1, 1, 0)));
  EXPECT_LT(glm::distance(normals[3], expected), 1e-6F);
}

TEST(SmoothNormals, vertices_without_a_face_point_along_z) {
  TriangleMesh mesh = test::single_triangle();
  mesh.positions.push_back({9, 9, 9});
  mesh.positions.push_back({8, 8, 8});
  mesh.triangles.push_back({3, 3, 4});
  const std::vector<Vec3f> normals = smooth_normals(mesh);
  EXPECT_EQ(normals[3], Vec3f(0, 0, 1));
  EXPECT_EQ(normals[4], Vec3f(0, 0, 1));
}

TEST(SmoothNormals, a_vertex_of_very_many_faces_gets_its_normal) {
  const TriangleMesh mesh = test::needle_fan(40000);
  const std::vector<Vec3f> normals = smooth_normals(mesh);
  EXPECT_GT(glm::dot(normals[0], glm::normalize(mesh.positions[0])), 0.8F);
}

}  // namespace
}  // namespace gridcast::mesh
