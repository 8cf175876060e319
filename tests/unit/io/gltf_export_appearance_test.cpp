#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "tests/unit/io/export_helpers.h"

namespace gridcast::test {
namespace {

using scene::SceneData;

SceneData one_sphere() {
  SceneData data;
  mesh::TriangleMesh ball = icosphere(3);
  Random random(5);
  for (const Vec3f& p : ball.positions)
    ball.normals.push_back(Vec3f(glm::normalize(Vec3d(p) + 0.1 * random.direction())));
  ball.parts = {{0, std::uint32_t(ball.triangle_count()), 0}};
  data.meshes = {share(ball)};
  data.deformations.resize(1);
  data.materials = {{.name = "glass",
                     .base_color = {0.1F, 0.2F, 0.7F, 0.9F},
                     .emissive = {0.3F, 0.1F, 0.F},
                     .metallic = 0.3F,
                     .roughness = 0.45F}};
  scene::place(data, 0, scene::random_affine(random, 1.0, 0.8));
  return data;
}

SceneData round_trip(SceneData data) {
  return import_ok(as_vector(exported(*scene::built(std::move(data)))));
}

TEST(GltfExportAppearance, materials_come_back_as_they_were) {
  SceneData data = one_sphere();
  data.materials.push_back({.name = "lamp",
                            .emissive = {0.1F, 7.3F, 1.7F},
                            .transmission = 0.4F,
                            .ior = 1.33F,
                            .double_sided = true});
  data.materials.push_back({.name = "", .emissive = {1.F, 4.F, 0.F}, .unlit = true});
  const std::vector<scene::Material> before = data.materials;
  const auto after = round_trip(std::move(data)).materials;
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(after[i].name, before[i].name);
    EXPECT_EQ(after[i].base_color, before[i].base_color);
    EXPECT_EQ(after[i].emissive, before[i].emissive);
    EXPECT_EQ(after[i].metallic, before[i].metallic);
    EXPECT_EQ(after[i].roughness, before[i].roughness);
    EXPECT_EQ(after[i].transmission, before[i].transmission);
    EXPECT_EQ(after[i].ior, before[i].ior);
    EXPECT_EQ(after[i].double_sided, before[i].double_sided);
    EXPECT_EQ(after[i].unlit, before[i].unlit);
  }
}

TEST(GltfExportAppearance, factors_stay_within_what_gltf_allows) {
  SceneData data = one_sphere();
  data.materials[0].emissive = {0.F, 7.3F, 2.F};
  const auto document = take_apart(exported(*scene::built(std::move(data)))).document;
  const auto& material = document["materials"][0];
  EXPECT_LE(material["emissiveFactor"][1].get<double>(), 1.0);
  EXPECT_EQ(material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"], 8.0);
  EXPECT_EQ(document["extensionsUsed"], nlohmann::json({"KHR_materials_emissive_strength"}));
}

TEST(GltfExportAppearance, numbers_without_a_text_are_bounded) {
  SceneData data = one_sphere();
  data.materials[0].ior = std::numeric_limits<float>::infinity();
  data.materials[0].emissive = {std::numeric_limits<float>::infinity(), std::nanf(""), 1.F};
  const auto material = round_trip(std::move(data)).materials[0];
  EXPECT_EQ(material.ior, std::numeric_limits<float>::max());
  EXPECT_EQ(material.emissive[1], 0.F);
}

TEST(GltfExportAppearance, cameras_come_back_as_they_were) {
  Random random(7);
  SceneData data = one_sphere();
  for (int i = 0; i < 20; ++i) {
    scene::Camera camera;
    if (i % 2 == 0) camera.name = "seen";
    camera.yfov_rad = random.uniform(0.1, 2.0);
    camera.znear = 0.01;
    if (i % 3 == 0) camera.aspect_ratio = 16.0 / 9.0;
    if (i % 4 == 0) camera.zfar = 1e4 / 3.0;
    if (i % 5 == 0) {
      camera.kind = scene::CameraKind::kOrthographic;
      camera.xmag = 1.0 / 3.0;
      camera.zfar = 100.0;
    }
    const Vec3d back = random.direction(), right = glm::normalize(glm::cross(random.direction(), back));
    camera.world_from_camera = {Mat3d(right, glm::cross(back, right), back), random.in_box(1e5)};
    data.cameras.push_back(camera);
  }
  const auto before = data.cameras;
  const auto after = round_trip(std::move(data)).cameras;
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(after[i].name, before[i].name);
    EXPECT_EQ(after[i].kind, before[i].kind);
    EXPECT_EQ(after[i].world_from_camera, before[i].world_from_camera);
    EXPECT_EQ(after[i].znear, before[i].znear);
    EXPECT_EQ(after[i].zfar, before[i].zfar);
    if (before[i].kind == scene::CameraKind::kPerspective) {
      EXPECT_EQ(after[i].yfov_rad, before[i].yfov_rad);
      EXPECT_EQ(after[i].aspect_ratio, before[i].aspect_ratio);
    } else {
      EXPECT_EQ(after[i].xmag, before[i].xmag);
      EXPECT_EQ(after[i].ymag, before[i].ymag);
    }
  }
}

TEST(GltfExportAppearance, lights_come_back_as_they_were) {
  Random random(8);
  SceneData data = one_sphere();
  for (int i = 0; i < 30; ++i) {
    scene::Light light;
    light.name = "light " + std::to_string(i);
    light.kind = scene::LightKind(i % 3);
    light.color = {0.3F, 0.9F, 1.F};
    light.intensity = random.uniform(0.1, 1e4);
    if (i % 2 == 0) light.range = random.uniform(1.0, 10.0);
    light.position = random.in_box(100.0);
    light.direction = random.direction();
    // Straight down the axes too, where a frame is easily degenerate.
    if (i < 6) light.direction = Vec3d(0.0);
    if (i < 6) light.direction[i % 3] = i < 3 ? 1.0 : -1.0;
    if (light.kind == scene::LightKind::kSpot) light.inner_cone_rad = 0.1;
    if (light.kind == scene::LightKind::kSpot) light.outer_cone_rad = 0.7;
    data.lights.push_back(light);
  }
  const auto before = data.lights;
  const auto after = round_trip(std::move(data)).lights;
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(after[i].name, before[i].name);
    EXPECT_EQ(after[i].kind, before[i].kind);
    EXPECT_EQ(after[i].color, before[i].color);
    EXPECT_EQ(after[i].intensity, before[i].intensity);
    EXPECT_EQ(after[i].range, before[i].range);
    EXPECT_EQ(after[i].position, before[i].position);
    EXPECT_EQ(after[i].direction, before[i].direction);
    EXPECT_EQ(after[i].inner_cone_rad, before[i].inner_cone_rad);
    EXPECT_EQ(after[i].outer_cone_rad, before[i].outer_cone_rad);
  }
}

TEST(GltfExportAppearance, normals_keep_their_bits) {
  const auto before = scene::built(one_sphere());
  const auto after = read_back(exported(*before));
  EXPECT_TRUE(after->blas(0).mesh().normals == before->blas(0).mesh().normals);
}

}  // namespace
}  // namespace gridcast::test
