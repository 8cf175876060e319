#include <gtest/gtest.h>

#include "tests/support/gltf_builder.h"
#include "tests/support/random.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

/// A document with a bit of everything.
std::vector<std::byte> rich_document() {
  GltfBuilder builder = triangle_document();
  auto& primitive = builder.document["meshes"][0]["primitives"][0];
  primitive["indices"] = builder.add_accessor<std::uint16_t>("SCALAR", {0, 1, 2, 2, 1, 0});
  primitive["attributes"]["NORMAL"] = builder.add_accessor<float>("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1});
  primitive["attributes"]["JOINTS_0"] =
      builder.add_accessor<std::uint8_t>("VEC4", {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  primitive["attributes"]["WEIGHTS_0"] =
      builder.add_accessor<float>("VEC4", {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  primitive["targets"] = {{{"POSITION", builder.add_accessor<float>("VEC3", std::vector<float>(9, 1.F))}}};
  primitive["material"] = 0;
  builder.document["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", 0.5}}}}};
  const int joint = builder.add_node({{"rotation", {0, 0, 0, 1}}, {"camera", 0}});
  builder.document["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 1}}}}};
  builder.document["skins"] = {{{"joints", {joint}}}};
  builder.document["nodes"][0]["skin"] = 0;
  const int times = builder.add_accessor<float>("SCALAR", {0, 1});
  const int places = builder.add_accessor<float>("VEC3", {0, 0, 0, 1, 1, 1});
  builder.document["animations"] = {
      {{"samplers", {{{"input", times}, {"output", places}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}}}};
  const nlohmann::json gpu = {{"attributes", {{"TRANSLATION", places}}}};
  builder.add_node({{"mesh", 0}, {"extensions", {{"EXT_mesh_gpu_instancing", gpu}}}});
  return builder.glb();
}

void mutate(std::vector<std::byte>& bytes, Random& random) {
  const std::uint32_t changes = 1 + random.below(4);
  for (std::uint32_t i = 0; i < changes; ++i) {
    std::byte& place = bytes[20 + random.below(std::uint32_t(bytes.size()) - 20)];
    const bool digit = place >= std::byte{'0'} && place <= std::byte{'9'};
    // Digits become digits, so that most documents still parse and reach the deeper checks.
    place = digit ? std::byte('0' + random.below(10)) : std::byte(random.below(256));
  }
}

/// Whatever came through must hold together.
void expect_consistent(const scene::SceneData& scene) {
  ASSERT_EQ(scene.meshes.size(), scene.deformations.size());
  for (const auto& mesh : scene.meshes) EXPECT_TRUE(mesh::validate(*mesh).ok());
  for (const auto& instance : scene.instances) {
    EXPECT_LT(instance.mesh_id, scene.meshes.size());
    EXPECT_LT(instance.node, scene.nodes.size());
  }
  for (std::size_t i = 0; i < scene.nodes.size(); ++i)
    EXPECT_TRUE(scene.nodes[i].parent == kInvalidId || scene.nodes[i].parent < i);
  for (const auto& skin : scene.skins) EXPECT_EQ(skin.joints.size(), skin.inverse_bind.size());
}

TEST(GltfMutations, damaged_documents_are_refused_or_consistent_and_never_crash) {
  const auto original = rich_document();
  ASSERT_TRUE(io::import_gltf(original).ok());
  Random random(seed_or(20261122));
  int loaded = 0;
  constexpr int kRounds = 5000;
  for (int round = 0; round < kRounds; ++round) {
    auto bytes = original;
    mutate(bytes, random);
    const auto scene = io::import_gltf(bytes);
    if (!scene) continue;
    ++loaded;
    expect_consistent(*scene);
  }
  EXPECT_GT(loaded, kRounds / 100) << "the mutations are too coarse to reach anything";
  EXPECT_LT(loaded, kRounds);
}

}  // namespace
}  // namespace gridcast::test
