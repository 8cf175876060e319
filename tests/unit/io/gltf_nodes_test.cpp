#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/gltf_builder.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

void expect_near(const Vec3d& a, const Vec3d& b, double tolerance = 1e-12) {
  EXPECT_LE(max_abs(a - b), tolerance)
      << a.x << " " << a.y << " " << a.z << " is not " << b.x << " " << b.y << " " << b.z;
}

/// A document with one mesh and no node.
GltfBuilder mesh_only() {
  GltfBuilder builder;
  const int positions = builder.add_accessor<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  builder.add_mesh({{"attributes", {{"POSITION", positions}}}});
  return builder;
}

const double kHalf = std::sqrt(0.5);

TEST(GltfNodes, transforms_of_a_chain_are_multiplied_in_double) {
  GltfBuilder builder = mesh_only();
  const int top = builder.add_node({{"translation", {1e6, 0, 0}}});
  const int turned = builder.add_node({{"rotation", {0, 0, kHalf, kHalf}}, {"scale", {2, 3, 4}}}, top);
  builder.add_node({{"mesh", 0}, {"translation", {0.125, 0, 0}}}, turned);
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.instances.size(), 1U);
  const Affine& world = scene.instances[0].world_from_object;
  expect_near(world.point({0, 0, 0}), {1e6, 0.25, 0}, 1e-9);
  expect_near(world.vector({1, 0, 0}), {0, 2, 0});
  expect_near(world.vector({0, 1, 0}), {-3, 0, 0});
  expect_near(world.vector({0, 0, 1}), {0, 0, 4});
}

TEST(GltfNodes, a_matrix_is_column_major_and_may_shear_and_mirror) {
  GltfBuilder builder = mesh_only();
  builder.add_node({{"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0.5, 2, 0, 0, 0, 0, 3, 0, 7, 8, 9, 1}}});
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.instances.size(), 1U);
  const Affine& world = scene.instances[0].world_from_object;
  EXPECT_EQ(world.point({1, 1, 1}), Vec3d(6.5, 10, 12));
  EXPECT_LT(glm::determinant(world.linear), 0.0);
}

TEST(GltfNodes, quaternions_are_normalised_and_zero_means_no_rotation) {
  GltfBuilder builder = mesh_only();
  builder.add_node({{"mesh", 0}, {"rotation", {0, 0, 1e30, 1e30}}});
  builder.add_node({{"mesh", 0}, {"rotation", {0, 0, 0, 0}}});
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.instances.size(), 2U);
  expect_near(scene.instances[0].world_from_object.vector({1, 0, 0}), {0, 1, 0});
  EXPECT_EQ(scene.instances[1].world_from_object.linear, Mat3d(1.0));
}

TEST(GltfNodes, parents_come_first_and_the_file_s_numbers_are_kept) {
  GltfBuilder builder = mesh_only();
  builder.document["nodes"] = {{{"name", "leaf"}, {"mesh", 0}},
                               {{"name", "middle"}, {"children", {0}}},
                               {{"name", "root"}, {"children", {1}}}};
  builder.document["scenes"][0]["nodes"] = {2};
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.nodes.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(scene.nodes[i].file_index, 2 - i);
    EXPECT_EQ(scene.nodes[i].parent, i == 0 ? kInvalidId : i - 1);
  }
  EXPECT_EQ(scene.instances.at(0).node, 2U);
  EXPECT_EQ(scene.instances.at(0).name.str(), "leaf");
}

TEST(GltfNodes, a_scene_is_chosen_by_index_or_by_default) {
  GltfBuilder builder = mesh_only();
  builder.document["nodes"] = {
      {{"mesh", 0}, {"name", "a"}}, {{"mesh", 0}, {"name", "b"}}, {{"mesh", 0}, {"name", "c"}}};
  builder.document["scenes"] = {{{"nodes", {0}}}, {{"name", "two"}, {"nodes", {1, 2}}}};
  builder.document["scene"] = 1;
  const auto by_default = import_ok(builder.glb());
  EXPECT_EQ(by_default.instances.size(), 2U);
  EXPECT_EQ(by_default.name, "two");
  io::GltfOptions options;
  options.scene_index = 0;
  const auto first = import_ok(builder.glb(), options);
  ASSERT_EQ(first.instances.size(), 1U);
  EXPECT_EQ(first.instances[0].name.str(), "a");
  options.scene_index = 2;
  const Error error = import_error(builder.glb(), options);
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_EQ(error.where, "/scenes/2");
}

TEST(GltfNodes, a_root_listed_twice_is_placed_once) {
  GltfBuilder builder = triangle_document();
  builder.document["scenes"][0]["nodes"] = {0, 0, 0};
  const auto scene = import_ok(builder.glb());
  EXPECT_EQ(scene.instances.size(), 1U);
  EXPECT_EQ(scene.warnings.size(), 2U);
}

TEST(GltfNodes, cycles_and_second_parents_are_refused_by_name) {
  GltfBuilder builder = mesh_only();
  builder.document["nodes"] = {{{"children", {1}}}, {{"children", {2}}}, {{"children", {0}}}};
  EXPECT_EQ(import_error(builder.glb()).where, "/nodes/0");
  builder.document["nodes"] = {{{"children", {2}}}, {{"children", {2}}}, nlohmann::json::object()};
  EXPECT_EQ(import_error(builder.glb()).where, "/nodes/1/children/0");
  builder.document["nodes"] = {{{"children", {1, 1}}}, nlohmann::json::object()};
  EXPECT_EQ(import_error(builder.glb()).where, "/nodes/0/children/1");
  builder.document["nodes"] = {{{"children", {0}}}};
  EXPECT_EQ(import_error(builder.glb()).where, "/nodes/0");
}

TEST(GltfNodes, a_chain_of_thirty_thousand_nodes_needs_no_stack) {
  GltfBuilder builder = mesh_only();
  int last = builder.add_node({{"translation", {1, 0, 0}}});
  for (int i = 1; i < 30'000; ++i) last = builder.add_node({{"translation", {1, 0, 0}}}, last);
  builder.add_node({{"mesh", 0}}, last);
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.instances.size(), 1U);
  EXPECT_EQ(scene.instances[0].world_from_object.translation, Vec3d(30'000, 0, 0));
}

TEST(GltfNodes, a_singular_transform_stays_with_a_warning) {
  GltfBuilder builder = mesh_only();
  builder.add_node({{"mesh", 0}, {"scale", {0, 0, 0}}});
  const auto scene = import_ok(builder.glb());
  EXPECT_EQ(scene.instances.size(), 1U);
  EXPECT_EQ(scene.warnings.size(), 1U);
}

TEST(GltfInstancing, each_entry_is_an_instance_below_its_node) {
  GltfBuilder builder = mesh_only();
  const int at = builder.add_accessor<float>("VEC3", {1, 0, 0, 0, 2, 0});
  const int turn = builder.add_accessor<std::int16_t>("VEC4", {0, 0, 0, 32767, 0, 0, 23170, 23170}, true);
  const int size = builder.add_accessor<float>("VEC3", {1, 1, 1, 5, 1, 1});
  const nlohmann::json gpu = {{"attributes", {{"TRANSLATION", at}, {"ROTATION", turn}, {"SCALE", size}}}};
  builder.add_node({{"mesh", 0}, {"name", "before"}});
  builder.add_node(
      {{"mesh", 0}, {"translation", {0, 0, 10}}, {"extensions", {{"EXT_mesh_gpu_instancing", gpu}}}});
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.instances.size(), 3U);
  EXPECT_EQ(scene.instances[0].name.str(), "before");
  expect_near(scene.instances[1].world_from_object.point({0, 0, 0}), {1, 0, 10});
  expect_near(scene.instances[2].world_from_object.point({1, 0, 0}), {0, 7, 10});
}

TEST(GltfInstancing, counts_must_agree_and_stay_below_the_limit) {
  GltfBuilder builder = mesh_only();
  const int two = builder.add_accessor<float>("VEC3", {1, 0, 0, 0, 2, 0});
  const int one = builder.add_accessor<float>("VEC3", {1, 1, 1});
  nlohmann::json gpu = {{"attributes", {{"TRANSLATION", two}, {"SCALE", one}}}};
  builder.add_node({{"mesh", 0}, {"extensions", {{"EXT_mesh_gpu_instancing", gpu}}}});
  EXPECT_EQ(import_error(builder.glb()).where, "/nodes/0/extensions/EXT_mesh_gpu_instancing");
  const int many = builder.describe_accessor("VEC3", 5126, 300'000'000, -1);
  gpu = {{"attributes", {{"TRANSLATION", many}}}};
  builder.document["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"] = gpu;
  EXPECT_EQ(import_error(builder.glb()).code, ErrorCode::kLimitExceeded);
}

TEST(GltfCameras, a_camera_is_placed_without_the_scale_of_its_node) {
  GltfBuilder builder;
  builder.document["cameras"] = {
      {{"type", "perspective"},
       {"perspective", {{"yfov", 0.5}, {"znear", 0.1}, {"zfar", 9}, {"aspectRatio", 2}}}},
      {{"type", "orthographic"}, {"orthographic", {{"xmag", 3}, {"ymag", 4}, {"znear", 0}, {"zfar", 5}}}}};
  builder.add_node(
      {{"camera", 0}, {"translation", {1, 2, 3}}, {"rotation", {0, kHalf, 0, kHalf}}, {"scale", {-2, 5, 3}}});
  builder.add_node({{"camera", 1}, {"name", "flat"}});
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.cameras.size(), 2U);
  const scene::Camera& camera = scene.cameras[0];
  EXPECT_EQ(camera.yfov_rad, 0.5);
  EXPECT_EQ(camera.aspect_ratio, 2.0);
  EXPECT_EQ(camera.zfar, 9.0);
  EXPECT_EQ(camera.world_from_camera.translation, Vec3d(1, 2, 3));
  expect_near(camera.world_from_camera.vector({0, 0, -1}), {-1, 0, 0});
  expect_near(camera.world_from_camera.vector({0, 1, 0}), {0, 1, 0});
  EXPECT_NEAR(glm::determinant(camera.world_from_camera.linear), 1.0, 1e-12);
  EXPECT_EQ(scene.cameras[1].kind, scene::CameraKind::kOrthographic);
  EXPECT_EQ(scene.cameras[1].xmag, 3.0);
  EXPECT_EQ(scene.cameras[1].name, "flat");
}

TEST(GltfLights, the_three_kinds_are_placed_in_world_space) {
  GltfBuilder builder;
  builder.document["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "directional"}, {"intensity", 2}, {"color", {1, 0.5, 0}}},
      {{"type", "point"}, {"range", 12}},
      {{"type", "spot"}, {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.2}}}}};
  for (int light = 0; light < 3; ++light) {
    builder.add_node({{"translation", {0, light, 0}},
                      {"rotation", {-kHalf, 0, 0, kHalf}},
                      {"extensions", {{"KHR_lights_punctual", {{"light", light}}}}}});
  }
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.lights.size(), 3U);
  EXPECT_EQ(scene.lights[0].kind, scene::LightKind::kDirectional);
  EXPECT_EQ(scene.lights[0].intensity, 2.0);
  EXPECT_EQ(scene.lights[0].color[1], 0.5F);
  expect_near(scene.lights[0].direction, {0, -1, 0});
  EXPECT_EQ(scene.lights[1].kind, scene::LightKind::kPoint);
  EXPECT_EQ(scene.lights[1].range, 12.0);
  EXPECT_EQ(scene.lights[1].position, Vec3d(0, 1, 0));
  EXPECT_EQ(scene.lights[2].kind, scene::LightKind::kSpot);
  EXPECT_EQ(scene.lights[2].outer_cone_rad, 0.2);
}

TEST(GltfMaterials, factors_and_extensions_are_read_with_their_defaults) {
  GltfBuilder builder;
  builder.document["materials"] = {
      nlohmann::json::object(),
      {{"name", "glass"},
       {"doubleSided", true},
       {"emissiveFactor", {1, 0.5, 0}},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.1, 0.2, 0.3, 0.4}}, {"metallicFactor", 0}, {"roughnessFactor", 0.25}}},
       {"extensions",
        {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}},
         {"KHR_materials_transmission", {{"transmissionFactor", 0.75}}},
         {"KHR_materials_ior", {{"ior", 1.25}}},
         {"KHR_materials_unlit", nlohmann::json::object()}}}}};
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.materials.size(), 2U);
  const scene::Material& plain = scene.materials[0];
  EXPECT_EQ(plain.base_color, (std::array<float, 4>{1, 1, 1, 1}));
  EXPECT_EQ(plain.metallic, 1.F);
  EXPECT_EQ(plain.ior, 1.5F);
  EXPECT_FALSE(plain.unlit || plain.double_sided);
  const scene::Material& glass = scene.materials[1];
  EXPECT_EQ(glass.name, "glass");
  EXPECT_EQ(glass.base_color[2], 0.3F);
  EXPECT_EQ(glass.emissive, (std::array<float, 3>{8, 4, 0}));
  EXPECT_EQ(glass.metallic, 0.F);
  EXPECT_EQ(glass.roughness, 0.25F);
  EXPECT_EQ(glass.transmission, 0.75F);
  EXPECT_EQ(glass.ior, 1.25F);
  EXPECT_TRUE(glass.unlit && glass.double_sided);
}

TEST(GltfExtensions, an_unknown_required_extension_is_unsupported_and_a_harmless_one_loads) {
  GltfBuilder builder = triangle_document();
  builder.document["extensionsRequired"] = {"KHR_texture_transform", "KHR_materials_anything"};
  EXPECT_EQ(world_triangles(import_ok(builder.glb())), 1U);
  builder.document["extensionsRequired"].push_back("ACME_folded_space");
  const Error error = import_error(builder.glb());
  EXPECT_EQ(error.code, ErrorCode::kUnsupported);
  EXPECT_EQ(error.where, "/extensionsRequired/2");
}

}  // namespace
}  // namespace gridcast::test
