// What build_scene makes of skins and morph targets, against tests/support/pose_reference.h.

#include <set>

#include <gtest/gtest.h>

#include "core/io/gltf.h"
#include "tests/support/assets.h"
#include "tests/support/pose_reference.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

/// A torus with a target and two joints, the second a child of the first, `offset` metres out.
SceneData rigged_torus(double offset) {
  SceneData data;
  mesh::TriangleMesh torus = test::torus(24, 12);
  const std::size_t count = torus.positions.size();
  MeshDeformation deformation;
  deformation.influences = 4;
  MorphTarget target;
  for (const Vec3f& p : torus.positions) {
    const float share = 0.5F + 0.5F * p.x / 1.3F;
    deformation.joints.insert(deformation.joints.end(), {0, 1, 0, 0});
    deformation.weights.insert(deformation.weights.end(), {1.F - share, share, 0.F, 0.F});
    target.positions.push_back(0.25F * p);
  }
  EXPECT_EQ(target.positions.size(), count);
  deformation.morph_targets = {target};
  data.meshes = {test::share(std::move(torus))};
  data.deformations = {deformation};
  data.nodes.resize(3);
  data.nodes[0].local = {Mat3d(0.5), Vec3d(offset, -offset, 3.0)};
  data.nodes[1].parent = 0;
  data.nodes[1].local = {Mat3d(0, 1, 0, -1, 0, 0, 0, 0, 1), Vec3d(0.1, 0.2, 0.3)};
  data.nodes[2].parent = 1;
  data.nodes[2].local = {Mat3d(1.0), Vec3d(0.0, 0.7, 0.0)};
  data.skins.push_back({"", {1, 2}, {Affine{}, Affine{Mat3d(1.0), Vec3d(0.0, -0.7, 0.1)}}, kInvalidId});
  return data;
}

std::uint32_t add_shown(SceneData& data, std::uint32_t skin_id, std::vector<float> weights) {
  Node node;
  node.local = {Mat3d(3.0), Vec3d(7.0, 8.0, 9.0)};
  node.weights = std::move(weights);
  const auto id = std::uint32_t(data.nodes.size());
  data.instances.push_back({{}, node.local, 0, id, skin_id});
  data.nodes.push_back(std::move(node));
  return std::uint32_t(data.instances.size() - 1);
}

/// Every vertex of every instance, in the world, within `relative` of the scene's size.
void expect_rest(const SceneData& data, const Scene& scene, double relative) {
  for (std::uint32_t id = 0; id < data.instances.size(); ++id) {
    const auto& instance = scene.instance(id);
    const auto& positions = scene.blas(instance.mesh_id).mesh().positions;
    const auto wanted = test::reference_rest(data, id);
    ASSERT_EQ(positions.size(), wanted.size());
    const Affine& place = instance.transform.world_from_object();
    for (std::size_t v = 0; v < positions.size(); ++v) {
      const Vec3d world = place.point(Vec3d(positions[v]));
      // Rounded to float where the mesh is, then moved in double.
      const double size = row_sum_norm(place.linear) * double(max_abs(positions[v]));
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_NEAR(world[axis], double(wanted[v][std::size_t(axis)]),
                    relative * size + 0x1p-46 * (1.0 + max_abs(place.translation)))
            << "instance " << id << ", vertex " << v;
      }
    }
  }
}

TEST(RestPose, meshes_that_share_skin_and_weights_are_one_and_others_come_after_the_files) {
  SceneData data = rigged_torus(0.0);
  data.skins.push_back(data.skins[0]);
  data.skins[1].inverse_bind[0].translation = {0.0, 2.0, 0.0};
  data.meshes.push_back(test::share(test::box({-1, -1, -1}, {1, 1, 1})));
  data.deformations.resize(2);
  add_shown(data, 0, {});               // the file's mesh, skinned
  add_shown(data, 1, {});               // by another skin
  add_shown(data, 0, {});               // the same as the first
  add_shown(data, 0, {0.5F});           // with other weights
  add_shown(data, kInvalidId, {0.5F});  // morphed alone, placed by its node
  add_shown(data, 1, {0.F});            // zero weights are those of the mesh
  const auto scene = built(data);
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 0; id < 6; ++id) ids.push_back(scene->instance(id).mesh_id);
  EXPECT_EQ(ids, (std::vector<std::uint32_t>{0, 2, 0, 3, 4, 2}));
  EXPECT_EQ(scene->mesh_count(), 5U);
  ASSERT_NO_FATAL_FAILURE(expect_rest(data, *scene, 0x1p-23));
  EXPECT_TRUE(scene->validate().ok());
  EXPECT_EQ(scene->blas(0).options().motion, blas::MeshMotion::kDeforms);
  EXPECT_EQ(scene->blas(1).options().motion, blas::MeshMotion::kStatic);
}

TEST(RestPose, nodes_whose_weights_are_animated_get_a_mesh_of_their_own) {
  SceneData data = rigged_torus(0.0);
  for (int i = 0; i < 4; ++i) add_shown(data, kInvalidId, {});
  AnimationChannel channel;
  channel.node = data.instances[2].node;
  channel.path = AnimationPath::kWeights;
  channel.times_s = {0.F};
  channel.values = {0.F};
  data.animations = {{"swell", {channel}}};
  const auto scene = built(data);
  EXPECT_EQ(scene->mesh_count(), 2U);
  EXPECT_EQ(scene->instance(1).mesh_id, 0U);
  EXPECT_EQ(scene->instance(2).mesh_id, 1U);
  EXPECT_EQ(scene->instance(3).mesh_id, 0U);
  // Nothing is bent yet, so the vertices are the file's, not a copy of them.
  EXPECT_EQ(scene->blas(0).mesh_ptr(), scene->blas(1).mesh_ptr());
}

TEST(RestPose, a_skin_far_out_keeps_its_precision) {
  for (const double offset : {0.0, 1e6, 1e9}) {
    SceneData data = rigged_torus(offset);
    add_shown(data, 0, {0.25F});
    const auto scene = built(data);
    ASSERT_NO_FATAL_FAILURE(expect_rest(data, *scene, 0x1p-23));
    EXPECT_LT(scene->blas(0).bounds().magnitude(), 10.F);
  }
}

TEST(RestPose, structures_answer_alike_over_bent_meshes) {
  test::Random random(test::seed_or(71));
  SceneData data = rigged_torus(0.0);
  add_shown(data, 0, {0.5F});
  add_shown(data, kInvalidId, {});
  const auto first = built(data);
  for (const auto kind :
       {blas::StructureKind::kBvh, blas::StructureKind::kCompactBvh, blas::StructureKind::kKdTree,
        blas::StructureKind::kBruteForce, blas::StructureKind::kEmbree}) {
    SceneBuildOptions options;
    options.blas.kind = kind;
    const auto other = built(data, options);
    for (int i = 0; i < 500; ++i) {
      const Ray ray = random_ray(*first, random);
      ASSERT_TRUE(same(intersect(*first, ray), intersect(*other, ray)));
    }
  }
}

TEST(RestPose, the_models_stand_as_their_files_say) {
  for (const char* file :
       {"skinned_fox/Fox.glb", "skinned_kaykit_mage/Mage.glb", "morph_stress/MorphStressTest.gltf",
        "morph_cube/AnimatedMorphCube.gltf", "simple_skin/quad_skin.glb", "sparse_morph/box_sparse.glb",
        "sparse_morph_tinygltf/singleBlendshapeCube_sparse.glb", "quantized_fox/fox_quantized.glb",
        "cameras_lights_skin_morph/24_animation_pointer.gltf", "instanced_overview/overview.glb"}) {
    SCOPED_TRACE(file);
    GRIDCAST_REQUIRE_ASSET(path, test::shared_asset(std::string("scenes/") + file));
    auto data = io::import_gltf_file(path);
    ASSERT_TRUE(data.ok()) << data.error().message;
    const auto scene = built(*data);
    ASSERT_NO_FATAL_FAILURE(expect_rest(*data, *scene, 0x1p-23));
    for (const std::string& warning : scene->data().warnings)
      EXPECT_EQ(warning.find("undeformed"), std::string::npos) << warning;
  }
}

TEST(RigCheck, the_offending_place_is_named) {
  const auto error = [](auto change) {
    SceneData data = rigged_torus(0.0);
    add_shown(data, 0, {});
    change(data);
    const auto scene = build_scene(data);
    return scene.ok() ? std::string("built") : scene.error().where;
  };
  EXPECT_EQ(error([](SceneData&) {}), "built");
  EXPECT_EQ(error([](SceneData& d) { d.nodes[1].parent = 1; }), "/nodes/1/parent");
  EXPECT_EQ(error([](SceneData& d) { d.nodes[2].local.translation.x = HUGE_VAL; }), "/nodes/2/local");
  EXPECT_EQ(error([](SceneData& d) { d.skins[0].joints[1] = 99; }), "/skins/0/joints");
  EXPECT_EQ(error([](SceneData& d) { d.skins[0].inverse_bind.pop_back(); }), "/skins/0/inverse_bind");
  EXPECT_EQ(error([](SceneData& d) { d.deformations[0].joints[5] = 2; }), "/instances/0/skin_id");
  EXPECT_EQ(error([](SceneData& d) { d.deformations[0].joints.pop_back(); }), "/deformations/0/joints");
  EXPECT_EQ(error([](SceneData& d) { d.instances[0].skin_id = 4; }), "/instances/0/skin_id");
  EXPECT_EQ(error([](SceneData& d) { d.instances[0].node = 40; }), "/instances/0/node");
  EXPECT_EQ(error([](SceneData& d) { d.instances[0].entry = 0; }), "/instances/0/entry");
  EXPECT_EQ(error([](SceneData& d) { d.nodes[1].local.linear *= 1e30; }), "/meshes/0/positions/0");
  AnimationChannel channel{9, AnimationPath::kScale, Interpolation::kLinear, {0.F}, {1.F, 1.F, 1.F}};
  EXPECT_EQ(error([&](SceneData& d) { d.animations = {{"", {channel}}}; }), "/animations/0/channels/0/node");
  channel.node = 0;
  channel.values.pop_back();
  EXPECT_EQ(error([&](SceneData& d) {
              d.animations = {{"", {channel}}};
            }),
            "/animations/0/channels/0/values");
}

}  // namespace
}  // namespace gridcast::scene
