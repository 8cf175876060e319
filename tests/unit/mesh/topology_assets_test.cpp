#include <gtest/gtest.h>

#include "core/io/gltf.h"
#include "core/mesh/topology.h"
#include "tests/support/assets.h"

namespace gridcast::mesh {
namespace {

struct Expected {
  const char* path;
  std::size_t triangles;
  std::size_t boundary_edges;
  std::size_t non_manifold_edges;
  std::size_t degenerate_faces;
};

// The figures of CATALOG.md, "Meshes as GLB". Where its columns come from welding within a tolerance or from
// edges of collapsed faces, ours differ by definition and stand here instead: featuretype (the catalogue
// welds vertices that are not equal), spot_degenerate_mix and spot_offset_1e6 (it counts edges of faces with
// repeated vertices).
constexpr Expected kMeshes[] = {
    {"nefertiti/nefertiti", 70'000, 0, 0, 0},
    {"koala/koala", 99'994, 0, 0, 0},
    {"scorpion/scorpion", 99'990, 0, 0, 0},
    {"bunny_hr/bunny_hr", 59'664, 0, 0, 0},
    {"spot/spot", 23'062, 0, 0, 0},
    {"goathead/goathead", 5'522, 0, 0, 0},
    {"mountain/mountain", 50'562, 636, 0, 0},
    {"cube_no_bottom/cube_no_bottom", 40, 8, 0, 0},
    {"wingnut/wingnut", 6'090, 0, 0, 0},
    {"featuretype/featuretype", 3'476, 576, 0, 0},
    {"busted/busted", 3'878, 0, 0, 0},
    {"soup/soup", 100, 300, 0, 0},
    {"cycloidal/cycloidal", 43'368, 0, 242, 0},
    {"not_convex/not_convex", 96, 0, 12, 0},
    {"adis16480/adis16480", 7'436, 0, 0, 0},
    {"box_many/box_many", 8'954, 0, 0, 0},
    {"stability/spot_degenerate_mix", 23'062, 3'698, 0, 813},
    {"stability/spot_offset_1e6", 23'062, 0, 89, 19'332},
    {"stability/spot_tiny", 23'062, 0, 0, 0},
    {"stability/spot_huge", 23'062, 0, 0, 0},
    {"stability/spot_sliver", 23'062, 0, 0, 0},
    {"stability/spot_coincident_copies", 69'186, 0, 34'593, 0},
    {"stability/spot_inside_out", 23'062, 0, 0, 0},
    {"stability/coplanar_grid_64", 8'192, 256, 0, 0},
};

TEST(TopologyOfAssets, agrees_with_the_catalogue) {
  GRIDCAST_REQUIRE_ASSET(folder, test::shared_asset("meshes"));
  for (const Expected& expected : kMeshes) {
    SCOPED_TRACE(expected.path);
    const auto data = io::import_gltf_file(folder / (std::string(expected.path) + ".glb"));
    ASSERT_TRUE(data.ok()) << data.error().message;
    ASSERT_EQ(data->meshes.size(), 1U);
    const TriangleMesh& mesh = *data->meshes[0];
    const TopologyReport report = analyse_topology(mesh);
    EXPECT_EQ(mesh.triangle_count(), expected.triangles);
    EXPECT_EQ(report.boundary_edges, expected.boundary_edges);
    EXPECT_EQ(report.non_manifold_edges, expected.non_manifold_edges);
    EXPECT_EQ(report.degenerate_faces, expected.degenerate_faces);
    EXPECT_EQ(report.closed, expected.boundary_edges == 0 && expected.non_manifold_edges == 0);
    for (const Vec3f& n : smooth_normals(mesh)) ASSERT_NEAR(glm::length(n), 1.F, 1e-5F);
  }
}

}  // namespace
}  // namespace gridcast::mesh
