#include <array>

#include <gtest/gtest.h>

#include "tests/support/assets.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

/// What a scene file holds, summed over its scenes.
struct Expected {
  const char* file;
  std::size_t stored_triangles, world_triangles, instances, nodes, skins, animations, cameras, lights;
  std::uint32_t scenes = 1;
};

constexpr std::array kScenes = {
    Expected{"pbr_flight_helmet/FlightHelmet.gltf", 94'722, 94'722, 6, 6, 0, 0, 0, 0},
    Expected{"instanced_overview/overview.glb", 14'462, 16'270, 1'159, 1'397, 1, 1, 1, 5},
    Expected{"instanced_whack_a_mole/WhackAMole.glb", 12'414, 85'698, 57, 68, 0, 21, 1, 1},
    Expected{"gpu_instancing_teapots/24_gpu_instancing.gltf", 4'034, 7'656'770, 1'900, 6, 0, 0, 0, 0},
    Expected{"instanced_teapots_nodes/teapots_nodes.glb", 4'034, 7'656'770, 1'900, 1'905, 0, 0, 0, 0},
    Expected{"skinned_fox/Fox.glb", 576, 576, 1, 26, 1, 3, 0, 0},
    Expected{"skinned_kaykit_mage/Mage.glb", 5'683, 5'683, 12, 54, 1, 76, 0, 0},
    Expected{"morph_stress/MorphStressTest.gltf", 2'412, 2'412, 1, 1, 0, 3, 0, 0},
    Expected{"morph_cube/AnimatedMorphCube.gltf", 12, 12, 1, 1, 0, 1, 0, 0},
    Expected{"cameras_lights_skin_morph/24_animation_pointer.gltf", 12'888, 14'436, 37, 64, 1, 1, 4, 4},
    Expected{"mirrored_building/subpass_scene_opaque.gltf", 11'132, 23'388, 70, 72, 0, 0, 0, 0},
    Expected{"draco_bike/model.gltf", 276'540, 276'540, 20, 20, 0, 0, 0, 0},
    Expected{"draco_truck_mirrored/model.gltf", 1'230, 2'370, 5, 7, 0, 0, 0, 0},
    Expected{"meshopt_pirate/pirate.glb", 5'010, 5'010, 1, 1, 0, 0, 0, 0},
    Expected{"meshopt_fallback/meshopt-fallback.gltf", 60, 60, 2, 4, 0, 0, 0, 0},
    Expected{"quantized_fox/fox_quantized.glb", 576, 576, 1, 27, 1, 3, 0, 0},
    Expected{"quantized_kenney_city/kenney_city_quantized.glb", 4'208, 258'958, 801, 2'432, 0, 0, 3, 10, 3},
    Expected{"meshopt_kenney_city/kenney_city_meshopt.glb", 4'208, 258'958, 801, 2'432, 0, 0, 3, 10, 3},
    Expected{"city_kenney/kenney_city.glb", 4'208, 258'958, 801, 1'631, 0, 0, 3, 10, 3},
    Expected{"large_hall_cc0/hall_cc0.glb", 1'321'231, 1'321'231, 61, 70, 0, 0, 0, 0},
    Expected{"sparse_morph/box_sparse.glb", 12, 12, 1, 1, 0, 1, 0, 0},
    Expected{"sparse_morph_tinygltf/singleBlendshapeCube_sparse.glb", 12, 12, 1, 2, 0, 1, 0, 0},
    Expected{"simple_skin/quad_skin.glb", 2, 2, 1, 23, 1, 0, 0, 0},
    Expected{"uri_with_spaces/CubeImageUriMultipleSpaces.gltf", 12, 12, 1, 1, 0, 0, 0, 0},
    Expected{"large_coordinates_ecef/0.glb", 103, 103, 1, 1, 0, 0, 0, 0},
};

scene::SceneData load(const std::filesystem::path& path, const io::GltfOptions& options = {}) {
  auto scene = io::import_gltf_file(path, options);
  if (scene) return std::move(scene).value();
  ADD_FAILURE() << path << ": " << scene.error().message << " at " << scene.error().where;
  return {};
}

TEST(GltfScenes, every_scene_has_the_counts_of_the_catalogue) {
  GRIDCAST_REQUIRE_ASSET(scenes, shared_asset("scenes"));
  for (const Expected& expected : kScenes) {
    SCOPED_TRACE(expected.file);
    std::size_t world = 0, instances = 0, cameras = 0, lights = 0;
    for (std::uint32_t index = 0; index < expected.scenes; ++index) {
      const auto scene = load(scenes / expected.file, {index, {}});
      world += world_triangles(scene);
      instances += scene.instances.size();
      cameras += scene.cameras.size();
      lights += scene.lights.size();
      EXPECT_EQ(stored_triangles(scene), expected.stored_triangles);
      EXPECT_EQ(scene.nodes.size(), expected.nodes);
      EXPECT_EQ(scene.skins.size(), expected.skins);
      EXPECT_EQ(scene.animations.size(), expected.animations);
    }
    EXPECT_EQ(world, expected.world_triangles);
    EXPECT_EQ(instances, expected.instances);
    EXPECT_EQ(cameras, expected.cameras);
    EXPECT_EQ(lights, expected.lights);
  }
}

TEST(GltfScenes, the_default_scene_of_the_city_has_784_instances) {
  GRIDCAST_REQUIRE_ASSET(city, shared_asset("scenes/city_kenney/kenney_city.glb"));
  EXPECT_EQ(load(city).instances.size(), 784U);
}

TEST(GltfScenes, every_mesh_file_loads) {
  GRIDCAST_REQUIRE_ASSET(meshes, shared_asset("meshes"));
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(meshes)) {
    if (entry.path().extension() != ".glb") continue;
    EXPECT_GT(world_triangles(load(entry.path())), 0U) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 24U);
}

TEST(GltfScenes, the_conformance_files_load_but_for_one_of_a_later_version) {
  GRIDCAST_REQUIRE_ASSET(folder, shared_asset("conformance/asset_generator"));
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".gltf") continue;
    ++files;
    // Its generator says that it must not load: minVersion is 2.1.
    const bool later = entry.path().filename() == "Compatibility_04.gltf";
    const auto scene = io::import_gltf_file(entry.path());
    EXPECT_EQ(scene.ok(), !later) << entry.path() << (scene.ok() ? "" : scene.error().message);
  }
  EXPECT_EQ(files, 51U);
}

TEST(GltfScenes, the_engine_has_its_29_meshes_and_67_instances_plain_and_draco) {
  GRIDCAST_REQUIRE_ASSET(plain, assimp_model("glTF2/2CylinderEngine-glTF-Binary/2CylinderEngine.glb"));
  GRIDCAST_REQUIRE_ASSET(packed, assimp_model("glTF2/draco/2CylinderEngine.gltf"));
  const auto engine = load(plain);
  EXPECT_EQ(engine.meshes.size(), 29U);
  EXPECT_EQ(engine.instances.size(), 67U);
  EXPECT_EQ(engine.cameras.size(), 1U);
  EXPECT_EQ(world_triangles(engine), 121'496U);
  const auto twin = load(packed);
  ASSERT_EQ(twin.instances.size(), 67U);
  EXPECT_EQ(stored_triangles(twin), 65'311U);
  EXPECT_EQ(world_triangles(twin), 110'336U);
  for (std::size_t i = 0; i < 67; ++i) {
    // The two files print their matrices with different numbers of digits.
    const Affine &a = twin.instances[i].world_from_object, &b = engine.instances[i].world_from_object;
    EXPECT_LE(max_abs(a.translation - b.translation), 1e-12) << i;
    for (int axis = 0; axis < 3; ++axis) EXPECT_LE(max_abs(a.linear[axis] - b.linear[axis]), 1e-12) << i;
  }
}

/// World positions of every corner, in order of instance, triangle and corner.
std::vector<Vec3d> world_corners(const scene::SceneData& scene) {
  std::vector<Vec3d> corners;
  for (const auto& instance : scene.instances) {
    const auto& mesh = *scene.meshes[instance.mesh_id];
    for (std::uint32_t t = 0; t < mesh.triangle_count(); ++t)
      for (const Vec3f& corner : mesh.corners(t))
        corners.push_back(instance.world_from_object.point(Vec3d(corner)));
  }
  return corners;
}

TEST(GltfScenes, instancing_by_extension_and_by_nodes_gives_the_same_world) {
  GRIDCAST_REQUIRE_ASSET(by_extension, shared_asset("scenes/gpu_instancing_teapots/24_gpu_instancing.gltf"));
  GRIDCAST_REQUIRE_ASSET(by_nodes, shared_asset("scenes/instanced_teapots_nodes/teapots_nodes.glb"));
  const auto centers = [](const scene::SceneData& scene) {
    std::vector<std::array<double, 4>> keys;
    for (const auto& instance : scene.instances) {
      const Vec3d p = instance.world_from_object.point({1, 2, 3});
      keys.push_back({p.x, p.y, p.z, double(scene.meshes[instance.mesh_id]->triangle_count())});
    }
    std::sort(keys.begin(), keys.end());
    return keys;
  };
  const auto a = centers(load(by_extension)), b = centers(load(by_nodes));
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(a[i][c], b[i][c], 1e-4) << i;
}

TEST(GltfScenes, the_meshopt_city_equals_the_quantised_one_exactly) {
  GRIDCAST_REQUIRE_ASSET(packed, shared_asset("scenes/meshopt_kenney_city/kenney_city_meshopt.glb"));
  GRIDCAST_REQUIRE_ASSET(plain, shared_asset("scenes/quantized_kenney_city/kenney_city_quantized.glb"));
  const auto a = load(packed), b = load(plain);
  ASSERT_EQ(a.meshes.size(), b.meshes.size());
  for (std::size_t m = 0; m < a.meshes.size(); ++m) {
    EXPECT_EQ(a.meshes[m]->positions.size(), b.meshes[m]->positions.size());
    EXPECT_EQ(a.meshes[m]->bounds(), b.meshes[m]->bounds());
    EXPECT_EQ(a.meshes[m]->triangle_count(), b.meshes[m]->triangle_count());
  }
  EXPECT_EQ(a.instances.size(), b.instances.size());
}

TEST(GltfScenes, the_quantised_fox_has_the_triangles_and_joints_of_the_plain_one) {
  GRIDCAST_REQUIRE_ASSET(quantised, shared_asset("scenes/quantized_fox/fox_quantized.glb"));
  GRIDCAST_REQUIRE_ASSET(plain, shared_asset("scenes/skinned_fox/Fox.glb"));
  const auto a = load(quantised), b = load(plain);
  EXPECT_EQ(world_corners(a).size(), world_corners(b).size());
  EXPECT_EQ(a.skins.at(0).joints.size(), 24U);
  EXPECT_EQ(b.skins.at(0).joints.size(), 24U);
}

TEST(GltfScenes, the_quantised_city_equals_the_plain_one_within_quantisation) {
  GRIDCAST_REQUIRE_ASSET(quantised, shared_asset("scenes/quantized_kenney_city/kenney_city_quantized.glb"));
  GRIDCAST_REQUIRE_ASSET(plain, shared_asset("scenes/city_kenney/kenney_city.glb"));
  auto a = world_corners(load(quantised)), b = world_corners(load(plain));
  ASSERT_EQ(a.size(), b.size());
  // The order of nodes differs, so the clouds are compared through their boxes and their sums.
  Bounds3d box_a, box_b;
  Vec3d sum_a(0.0), sum_b(0.0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    box_a.extend(a[i]);
    box_b.extend(b[i]);
    sum_a += a[i];
    sum_b += b[i];
  }
  EXPECT_LE(max_abs(box_a.lower - box_b.lower), 1e-2);
  EXPECT_LE(max_abs(box_a.upper - box_b.upper), 1e-2);
  EXPECT_LE(max_abs(sum_a - sum_b) / double(a.size()), 1e-3);
}

TEST(GltfScenes, a_far_away_scene_keeps_its_offset_in_double) {
  GRIDCAST_REQUIRE_ASSET(ecef, shared_asset("scenes/large_coordinates_ecef/0.glb"));
  const auto scene = load(ecef);
  EXPECT_GT(max_abs(scene.instances.at(0).world_from_object.translation), 1e6);
  EXPECT_LT(scene.meshes.at(0)->bounds().magnitude(), 1e5F);
}

}  // namespace
}  // namespace gridcast::test
