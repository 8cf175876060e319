#include <gtest/gtest.h>

#include "tests/support/gltf_builder.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

/// A triangle skinned to two joints: node 0 shows the mesh, nodes 1 and 2 are the joints.
GltfBuilder skinned_triangle() {
  GltfBuilder builder = triangle_document();
  auto& attributes = builder.document["meshes"][0]["primitives"][0]["attributes"];
  attributes["JOINTS_0"] = builder.add_accessor<std::uint8_t>("VEC4", {0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0});
  attributes["WEIGHTS_0"] =
      builder.add_accessor<std::uint8_t>("VEC4", {255, 0, 0, 0, 255, 0, 0, 0, 51, 204, 0, 0}, true);
  const int first = builder.add_node({{"name", "first"}});
  builder.add_node({{"name", "second"}, {"translation", {0, 1, 0}}}, first);
  const std::vector<float> matrices = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                                       1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1};
  const int inverse = builder.add_accessor<float>("MAT4", matrices);
  builder.document["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", inverse}, {"skeleton", 1}}};
  builder.document["nodes"][0]["skin"] = 0;
  return builder;
}

TEST(GltfSkins, joints_weights_and_bind_matrices_are_kept) {
  const auto scene = import_ok(skinned_triangle().glb());
  ASSERT_EQ(scene.skins.size(), 1U);
  const scene::Skin& skin = scene.skins[0];
  ASSERT_EQ(skin.joints.size(), 2U);
  EXPECT_EQ(scene.nodes[skin.joints[0]].name, "first");
  EXPECT_EQ(scene.nodes[skin.joints[1]].name, "second");
  EXPECT_EQ(skin.skeleton, skin.joints[0]);
  EXPECT_EQ(skin.inverse_bind[1].translation, Vec3d(0, -1, 0));
  const scene::MeshDeformation& deformation = scene.deformations.at(0);
  EXPECT_EQ(deformation.influences, 4U);
  EXPECT_EQ(deformation.joints, (std::vector<std::uint16_t>{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}));
  EXPECT_FLOAT_EQ(deformation.weights.at(8), 0.2F);
  EXPECT_EQ(scene.instances.at(0).skin_id, 0U);
}

TEST(GltfSkins, a_second_set_of_joints_makes_eight_influences) {
  GltfBuilder builder = skinned_triangle();
  auto& attributes = builder.document["meshes"][0]["primitives"][0]["attributes"];
  attributes["JOINTS_1"] = builder.add_accessor<std::uint16_t>("VEC4", {1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0});
  attributes["WEIGHTS_1"] = builder.add_accessor<float>("VEC4", {0.5F, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  const auto scene = import_ok(builder.glb());
  const scene::MeshDeformation& deformation = scene.deformations.at(0);
  EXPECT_EQ(deformation.influences, 8U);
  ASSERT_EQ(deformation.joints.size(), 24U);
  EXPECT_EQ(deformation.joints[4], 1U);
  EXPECT_EQ(deformation.weights[4], 0.5F);
  EXPECT_EQ(deformation.joints[8], 1U);
}

TEST(GltfSkins, a_joint_the_skin_does_not_have_is_refused) {
  GltfBuilder builder = skinned_triangle();
  builder.document["skins"][0]["joints"] = {1};
  EXPECT_EQ(import_error(builder.glb()).where, "/nodes/0/skin");
}

TEST(GltfSkins, too_few_bind_matrices_are_refused) {
  GltfBuilder builder = skinned_triangle();
  builder.document["skins"][0]["joints"] = {1, 2, 0};
  EXPECT_EQ(import_error(builder.glb()).where, "/skins/0/inverseBindMatrices");
}

GltfBuilder morphed_triangle() {
  GltfBuilder builder = triangle_document();
  auto& mesh = builder.document["meshes"][0];
  const int moved = builder.add_accessor<float>("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1});
  const int turned = builder.add_accessor<float>("VEC3", {0, 1, 0, 0, 1, 0, 0, 1, 0});
  mesh["primitives"][0]["targets"] = {{{"POSITION", moved}}, {{"POSITION", moved}, {"NORMAL", turned}}};
  mesh["weights"] = {0.25, 0};
  return builder;
}

TEST(GltfMorphTargets, displacements_and_weights_are_kept) {
  GltfBuilder builder = morphed_triangle();
  builder.document["nodes"][0]["weights"] = {0.5, 1};
  const auto scene = import_ok(builder.glb());
  const scene::MeshDeformation& deformation = scene.deformations.at(0);
  ASSERT_EQ(deformation.morph_targets.size(), 2U);
  EXPECT_EQ(deformation.morph_targets[0].positions, std::vector<Vec3f>(3, Vec3f(0, 0, 1)));
  EXPECT_TRUE(deformation.morph_targets[0].normals.empty());
  EXPECT_EQ(deformation.morph_targets[1].normals, std::vector<Vec3f>(3, Vec3f(0, 1, 0)));
  EXPECT_EQ(deformation.default_weights, (std::vector<float>{0.25F, 0.F}));
  EXPECT_EQ(scene.nodes.at(0).weights, (std::vector<float>{0.5F, 1.F}));
}

/// Adds an animation of node 0 with the given sampler.
void animate(GltfBuilder& builder, const char* path, const char* interpolation, int input, int output) {
  nlohmann::json sampler = {{"input", input}, {"output", output}, {"interpolation", interpolation}};
  nlohmann::json channel = {{"sampler", 0}, {"target", {{"node", 0}, {"path", path}}}};
  nlohmann::json animation = {{"name", "move"}, {"samplers", {sampler}}, {"channels", {channel}}};
  builder.document["animations"] = {animation};
}

TEST(GltfAnimations, every_path_and_interpolation_is_kept) {
  struct Case {
    const char* path;
    const char* interpolation;
    const char* type;
    std::size_t values;
    scene::AnimationPath expected_path;
    scene::Interpolation expected_interpolation;
  };
  using enum scene::AnimationPath;
  using enum scene::Interpolation;
  const Case cases[] = {{"translation", "LINEAR", "VEC3", 6, kTranslation, kLinear},
                        {"rotation", "STEP", "VEC4", 8, kRotation, kStep},
                        {"scale", "CUBICSPLINE", "VEC3", 18, kScale, kCubicSpline},
                        {"weights", "LINEAR", "SCALAR", 4, kWeights, kLinear}};
  for (const Case& test : cases) {
    GltfBuilder builder = morphed_triangle();
    const int times = builder.add_accessor<float>("SCALAR", {0, 1.5F});
    const int values = builder.add_accessor<float>(test.type, std::vector<float>(test.values, 0.5F));
    animate(builder, test.path, test.interpolation, times, values);
    const auto scene = import_ok(builder.glb());
    ASSERT_EQ(scene.animations.size(), 1U);
    EXPECT_EQ(scene.animations[0].name, "move");
    ASSERT_EQ(scene.animations[0].channels.size(), 1U);
    const scene::AnimationChannel& channel = scene.animations[0].channels[0];
    EXPECT_EQ(channel.node, 0U);
    EXPECT_EQ(channel.path, test.expected_path);
    EXPECT_EQ(channel.interpolation, test.expected_interpolation);
    EXPECT_EQ(channel.times_s, (std::vector<float>{0, 1.5F}));
    EXPECT_EQ(channel.values.size(), test.values);
  }
}

TEST(GltfAnimations, short_outputs_and_disordered_times_are_refused) {
  const auto refused_at = [](const std::vector<float>& times, std::size_t outputs,
                             const char* interpolation) {
    GltfBuilder builder = triangle_document();
    const int input = builder.add_accessor<float>("SCALAR", times);
    const int output = builder.add_accessor<float>("VEC3", std::vector<float>(outputs * 3, 0.F));
    animate(builder, "translation", interpolation, input, output);
    return import_error(builder.glb()).where;
  };
  EXPECT_EQ(refused_at({0, 1}, 1, "LINEAR"), "/animations/0/samplers/0/output");
  EXPECT_EQ(refused_at({0, 1}, 2, "CUBICSPLINE"), "/animations/0/samplers/0/output");
  EXPECT_EQ(refused_at({1, 0}, 2, "LINEAR"), "/animations/0/samplers/0/input");
  EXPECT_EQ(refused_at({0, std::nanf("")}, 2, "LINEAR"), "/animations/0/samplers/0/input");
}

}  // namespace
}  // namespace gridcast::test
