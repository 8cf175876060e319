#include <gtest/gtest.h>

#include "tests/support/gltf_builder.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

using Triangles = std::vector<mesh::Triangle>;

/// Five vertices of a zigzag.
GltfBuilder zigzag(int mode) {
  GltfBuilder builder;
  const int positions = builder.add_accessor<float>("VEC3", {0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0, 2, 0, 0});
  builder.add_node({{"mesh", builder.add_mesh({{"attributes", {{"POSITION", positions}}}, {"mode", mode}})}});
  return builder;
}

TEST(GltfPrimitives, a_strip_turns_its_odd_triangles) {
  const auto scene = import_ok(zigzag(5).glb());
  EXPECT_EQ(scene.meshes.at(0)->triangles, (Triangles{{0, 1, 2}, {1, 3, 2}, {2, 3, 4}}));
}

TEST(GltfPrimitives, a_fan_turns_around_its_first_vertex) {
  const auto scene = import_ok(zigzag(6).glb());
  EXPECT_EQ(scene.meshes.at(0)->triangles, (Triangles{{1, 2, 0}, {2, 3, 0}, {3, 4, 0}}));
}

TEST(GltfPrimitives, the_rest_of_an_incomplete_list_is_skipped_with_a_warning) {
  const auto scene = import_ok(zigzag(4).glb());
  EXPECT_EQ(scene.meshes.at(0)->triangles, (Triangles{{0, 1, 2}}));
  EXPECT_EQ(scene.warnings.size(), 1U);
}

TEST(GltfPrimitives, points_and_lines_leave_an_empty_mesh_and_a_warning) {
  for (const int mode : {0, 1, 2, 3}) {
    const auto scene = import_ok(zigzag(mode).glb());
    ASSERT_EQ(scene.meshes.size(), 1U);
    EXPECT_EQ(scene.meshes[0]->triangle_count(), 0U);
    EXPECT_EQ(scene.warnings.size(), 1U);
    EXPECT_EQ(scene.instances.size(), 1U);
  }
}

TEST(GltfPrimitives, primitives_are_joined_in_order_with_their_materials) {
  GltfBuilder builder = triangle_document();
  builder.document["materials"] = {{{"name", "red"}}, {{"name", "blue"}}};
  auto& primitives = builder.document["meshes"][0]["primitives"];
  const int other = builder.add_accessor<float>("VEC3", {5, 0, 0, 6, 0, 0, 5, 1, 0});
  primitives.push_back({{"attributes", {{"POSITION", other}}}, {"material", 1}});
  primitives.push_back({{"attributes", {{"POSITION", 0}}}, {"material", 0}});
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.meshes.size(), 1U);
  const mesh::TriangleMesh& mesh = *scene.meshes[0];
  EXPECT_EQ(mesh.triangles, (Triangles{{0, 1, 2}, {3, 4, 5}, {0, 1, 2}}))
      << "the third shares the first's vertices";
  ASSERT_EQ(mesh.parts.size(), 3U);
  EXPECT_EQ(mesh.parts[0].material_id, kInvalidId);
  EXPECT_EQ(mesh.parts[1].material_id, 1U);
  EXPECT_EQ(mesh.parts[2].material_id, 0U);
  EXPECT_EQ(mesh.part_of(1), 1U);
  EXPECT_EQ(mesh.positions[3], Vec3f(5, 0, 0));
}

TEST(GltfPrimitives, normals_are_kept_only_when_every_primitive_has_them) {
  GltfBuilder builder = triangle_document();
  auto& primitives = builder.document["meshes"][0]["primitives"];
  const int normals = builder.add_accessor<float>("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1});
  primitives.push_back({{"attributes", {{"POSITION", 0}, {"NORMAL", normals}}}});
  EXPECT_TRUE(import_ok(builder.glb()).meshes.at(0)->normals.empty());
}

TEST(GltfPrimitives, an_index_out_of_range_is_refused_and_named) {
  GltfBuilder builder = triangle_document();
  builder.document["meshes"][0]["primitives"][0]["indices"] =
      builder.add_accessor<std::uint16_t>("SCALAR", {0, 1, 3});
  const Error error = import_error(builder.glb());
  EXPECT_EQ(error.where, "/meshes/0/primitives/0/indices");
  EXPECT_NE(error.message.find("vertex 3"), std::string::npos) << error.message;
}

TEST(GltfPrimitives, meshes_keep_the_file_s_numbers_even_when_nothing_shows_them) {
  GltfBuilder builder = triangle_document();
  builder.add_mesh({{"attributes", {{"POSITION", 0}}}, {"mode", 0}});
  builder.add_mesh({{"attributes", {{"POSITION", 0}}}});
  builder.document["meshes"][2]["name"] = "spare";
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.meshes.size(), 3U);
  EXPECT_EQ(scene.deformations.size(), 3U);
  EXPECT_EQ(scene.meshes[2]->name, "spare");
  EXPECT_EQ(scene.instances.size(), 1U);
}

TEST(GltfPrimitives, attributes_of_different_lengths_are_refused) {
  GltfBuilder builder = triangle_document();
  const int normals = builder.add_accessor<float>("VEC3", {0, 0, 1});
  builder.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals;
  EXPECT_EQ(import_error(builder.glb()).code, ErrorCode::kInvalidFile);
}

}  // namespace
}  // namespace gridcast::test
