// Poses as edits of a scene, against tests/support/pose_reference.h and against scenes built anew.

#include "core/scene/pose.h"

#include <limits>

#include <gtest/gtest.h>

#include "core/io/gltf.h"
#include "core/scene/animation.h"
#include "core/scene/flatten.h"
#include "core/scene/update.h"
#include "tests/support/assets.h"
#include "tests/support/pose_reference.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

AnimationChannel channel(std::uint32_t node, AnimationPath path, std::vector<float> times,
                         std::vector<float> values, Interpolation interpolation = Interpolation::kLinear) {
  return {node, path, interpolation, std::move(times), std::move(values)};
}

/// Nodes: 0 root, 1 arm and 2 hand (the skin's joints), 3 shows a skinned and morphed torus, 4 shows a box
/// that only moves, 5 shows it once more as a child of 4, at an entry.
SceneData puppet() {
  SceneData data;
  mesh::TriangleMesh torus = test::torus(24, 12);
  MeshDeformation deformation;
  deformation.influences = 4;
  deformation.morph_targets.resize(2);
  for (const Vec3f& p : torus.positions) {
    const float share = 0.5F + 0.5F * p.x / 1.3F;
    deformation.joints.insert(deformation.joints.end(), {0, 1, 0, 0});
    deformation.weights.insert(deformation.weights.end(), {1.F - share, share, 0.F, 0.F});
    deformation.morph_targets[0].positions.push_back(0.25F * p);
    deformation.morph_targets[1].positions.push_back({0.F, p.x * p.x, 0.F});
  }
  data.meshes = {test::share(std::move(torus)), test::share(test::box({-1, -1, -1}, {1, 1, 1}))};
  data.deformations = {deformation, {}};
  const std::pair<const char*, std::uint32_t> nodes[] = {
      {"root", kInvalidId}, {"arm", 0}, {"hand", 1}, {"torus", kInvalidId}, {"box", kInvalidId}, {"box", 4}};
  for (const auto& [name, parent] : nodes) {
    Node& node = data.nodes.emplace_back();
    node.name = name;
    node.parent = parent;
    node.trs.translation = {0.1 * double(data.nodes.size()), 0.5, -0.25};
    node.local = affine_from_trs(node.trs);
  }
  data.skins.push_back({"bones", {1, 2}, {Affine{}, Affine{Mat3d(1.0), Vec3d(0.0, -0.7, 0.1)}}, kInvalidId});
  data.entries = {{Mat3d(0.5), Vec3d(3.0, 0.0, 0.0)}};
  data.instances = {{SharedText("torus"), data.nodes[3].local, 0, 3, 0},
                    {SharedText("box"), data.nodes[4].local, 1, 4},
                    {SharedText("small box"), data.nodes[4].local * data.nodes[5].local * data.entries[0], 1,
                     5, kInvalidId, 0},
                    {SharedText("alone"), {Mat3d(0.25), Vec3d(0.0, 9.0, 0.0)}, 1}};
  data.animations = {
      {"wave",
       {channel(1, AnimationPath::kRotation, {0.F, 0.5F, 2.F}, {0, 0, 0, 1, 0, 0, 1, 1, 0, 1, 0, 0.2F}),
        channel(2, AnimationPath::kTranslation, {0.25F, 1.F}, {0, 0.7F, 0, 0.3F, 1.F, 0},
                Interpolation::kStep),
        channel(0, AnimationPath::kTranslation, {0.F, 2.F},
                {0, 0, 0, 0, 0, 0, 1, 2, 0, 0, 1, 0, 3, 1, 0, 0, 0, 0}, Interpolation::kCubicSpline),
        channel(3, AnimationPath::kWeights, {0.F, 1.5F}, {0.F, 0.F, 1.F, -0.3F})}},
      {"slide", {channel(4, AnimationPath::kTranslation, {0.F, 1.F}, {0, 0, 0, 5, 0, 0})}},
      {"vanish", {channel(4, AnimationPath::kScale, {0.F, 1.F}, {1, 1, 1, 0, 0, 0})}}};
  return data;
}

SetPose animated(ElementRef animation, double time_s, AnimationWrap wrap = AnimationWrap::kClamp) {
  SetPose edit;
  edit.animation = AnimationTime{std::move(animation), time_s, wrap};
  return edit;
}

std::shared_ptr<const Scene> posed(const Scene& scene, const SetPose& edit) {
  auto result = apply_update(scene, {edit});
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message + " " + result.error().where);
  return result ? result->scene : nullptr;
}

/// Every vertex of every instance, in the world: rounded to float where the mesh is, then moved in double.
void expect_points(const Scene& scene, const test::ReferencePose& pose) {
  const SceneData& data = scene.data();
  for (std::uint32_t id = 0; id < data.instances.size(); ++id) {
    const auto& instance = scene.instance(id);
    const auto& positions = scene.blas(instance.mesh_id).mesh().positions;
    const auto wanted = test::reference_points(data, pose, id);
    ASSERT_EQ(positions.size(), wanted.size());
    const Affine& place = instance.transform.world_from_object();
    for (std::size_t v = 0; v < positions.size(); ++v) {
      const Vec3d world = place.point(Vec3d(positions[v]));
      const double size = row_sum_norm(place.linear) * double(max_abs(positions[v]));
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_NEAR(world[axis], double(wanted[v][std::size_t(axis)]),
                    0x1p-23 * size + 0x1p-44 * (1.0 + max_abs(place.translation)))
            << "instance " << id << ", vertex " << v;
      }
    }
  }
}

void expect_animations(SceneData data) {
  const auto scene = built(std::move(data));
  const auto& animations = scene->data().animations;
  ASSERT_FALSE(animations.empty());
  const std::size_t step = std::max<std::size_t>(1, animations.size() / 6);
  for (std::uint32_t a = 0; a < animations.size(); a += std::uint32_t(step)) {
    const double duration = duration_s(animations[a]);
    for (const double share : {0.0, 0.13, 0.5, 0.77, 1.0}) {
      SCOPED_TRACE("animation " + std::to_string(a) + " at " + std::to_string(share * duration));
      const auto frame = posed(*scene, animated(a, share * duration));
      ASSERT_NE(frame, nullptr);
      ASSERT_NO_FATAL_FAILURE(
          expect_points(*frame, test::reference_animated(scene->data(), a, share * duration)));
      EXPECT_TRUE(frame->validate().ok());
    }
  }
}

TEST(Pose, animations_put_every_vertex_where_the_specification_says) {
  ASSERT_NO_FATAL_FAILURE(expect_animations(puppet()));
}

TEST(Pose, animations_of_models_put_every_vertex_where_the_specification_says) {
  std::size_t found = 0;
  const auto look = [&](const std::optional<std::filesystem::path>& path, const std::string& name) {
    if (!path) return void(std::printf("[ absent ] %s\n", name.c_str()));
    SCOPED_TRACE(name);
    ++found;
    auto data = io::import_gltf_file(*path);
    ASSERT_TRUE(data.ok()) << data.error().message;
    expect_animations(std::move(data).value());
  };
  for (const char* file :
       {"skinned_fox/Fox.glb", "skinned_kaykit_mage/Mage.glb", "morph_stress/MorphStressTest.gltf",
        "morph_cube/AnimatedMorphCube.gltf", "sparse_morph_tinygltf/singleBlendshapeCube_sparse.glb",
        "quantized_fox/fox_quantized.glb", "instanced_whack_a_mole/WhackAMole.glb",
        "cameras_lights_skin_morph/24_animation_pointer.gltf"})
    look(test::shared_asset(std::string("scenes/") + file), file);
  for (const char* file : {"glTF2/simple_skin/simple_skin.gltf",
                           "glTF2/glTF-Sample-Models/AnimatedMorphCube-glTF/AnimatedMorphCube.gltf"})
    look(test::assimp_model(file), file);
  if (found == 0) GTEST_SKIP() << "no model on this machine";
}

TEST(Pose, times_are_clamped_or_begin_again) {
  const auto scene = built(puppet());
  const auto time = [&](double asked, AnimationWrap wrap) {
    return posed(*scene, animated("wave", asked, wrap))->pose().animation->time_s;
  };
  EXPECT_EQ(time(-1.0, AnimationWrap::kClamp), 0.0);
  EXPECT_EQ(time(9.0, AnimationWrap::kClamp), 2.0);
  EXPECT_EQ(time(-0.5, AnimationWrap::kLoop), 1.5);
  EXPECT_EQ(time(4.25, AnimationWrap::kLoop), 0.25);
}

TEST(Pose, rest_undoes_and_present_goes_on) {
  const auto scene = built(puppet());
  const auto waved = posed(*scene, animated("wave", 1.0));
  SetPose slide = animated("slide", 1.0);
  slide.base = PoseBase::kPresent;
  const auto both = posed(*waved, slide);
  EXPECT_EQ(both->blas(0).mesh_ptr(), waved->blas(0).mesh_ptr());
  EXPECT_EQ(both->instance(1).transform.world_from_object().translation.x, 5.0);
  slide.base = PoseBase::kRest;
  const auto slid = posed(*waved, slide);
  EXPECT_EQ(slid->blas(0).mesh().positions, scene->blas(0).mesh().positions);
  const auto rest = posed(*both, SetPose{});
  EXPECT_EQ(rest->blas(0).mesh().positions, scene->blas(0).mesh().positions);
  for (std::uint32_t id = 0; id < 4; ++id)
    EXPECT_EQ(rest->instance(id).transform.world_from_object(),
              scene->instance(id).transform.world_from_object());
  EXPECT_FALSE(rest->pose().animation.has_value());
}

TEST(Pose, what_a_pose_does_not_change_stays_where_other_edits_put_it) {
  const auto scene = built(puppet());
  const Affine elsewhere{Mat3d(2.0), Vec3d(50.0)};
  auto moved = apply_update(
      *scene, {MoveInstance{1, elsewhere}, AddInstance{0, elsewhere, "twin"}, RemoveInstance{2}});
  ASSERT_TRUE(moved.ok());
  // The arm alone moves: the box stays, and the twin waves where it was put.
  SetPose arm;
  arm.base = PoseBase::kPresent;
  arm.nodes = {{"arm", TrsParts{std::nullopt, std::array<double, 4>{0, 0, 1, 1}, std::nullopt}}};
  const auto result = apply_update(*moved->scene, {arm});
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->scene->instance(1).transform.world_from_object(), elsewhere);
  EXPECT_EQ(result->report.poses.at(0).moved_instances, 0U);
  EXPECT_EQ(result->scene->instance(4).transform.world_from_object(), elsewhere);
  EXPECT_NE(result->scene->blas(0).mesh().positions, scene->blas(0).mesh().positions);
  // The box's node moves: the box goes with it, the removed one does not come back.
  SetPose box;
  box.nodes = {{4U, Affine{Mat3d(1.0), Vec3d(7.0)}}};
  const auto last = apply_update(*result->scene, {box});
  ASSERT_TRUE(last.ok());
  EXPECT_EQ(last->report.poses.at(0).moved_instances, 1U);
  EXPECT_EQ(last->scene->instance(1).transform.world_from_object().translation, Vec3d(7.0));
  EXPECT_FALSE(last->scene->find_instance(2));
  EXPECT_TRUE(last->scene->validate().ok());
}

TEST(Pose, joint_matrices_are_worlds_times_inverse_bind_matrices) {
  const auto scene = built(puppet());
  const SceneData& data = scene->data();
  const auto waved = posed(*scene, animated("wave", 0.8));
  SetPose joints;
  joints.skins = {{"bones", {}}};
  for (std::size_t j = 0; j < 2; ++j)
    joints.skins[0].joint_matrices.push_back(waved->pose().nodes->worlds[data.skins[0].joints[j]] *
                                             data.skins[0].inverse_bind[j]);
  joints.weights = {{0, waved->pose().weights.at(0)}};
  const auto given = posed(*scene, joints);
  const auto &a = waved->blas(0).mesh().positions, &b = given->blas(0).mesh().positions;
  const Vec3d shift = waved->instance(0).transform.world_from_object().translation -
                      given->instance(0).transform.world_from_object().translation;
  for (std::size_t v = 0; v < a.size(); ++v)
    for (int axis = 0; axis < 3; ++axis)
      ASSERT_NEAR(double(a[v][axis]) + shift[axis], double(b[v][axis]), 1e-6);
  // They hold until the skin follows its nodes again.
  SetPose again = animated("wave", 0.8);
  again.base = PoseBase::kPresent;
  EXPECT_EQ(posed(*given, again)->pose().joints.size(), 1U);
  EXPECT_EQ(posed(*given, animated("wave", 0.8))->blas(0).mesh().positions, a);
}

TEST(Pose, edits_of_one_update_are_applied_in_their_order) {
  const auto scene = built(puppet());
  SetPose weights;
  weights.base = PoseBase::kPresent;
  weights.weights = {{0, {1.0, 0.0}}};
  const Affine elsewhere{Mat3d(1.0), Vec3d(20.0)};
  const std::vector<std::uint32_t> ids{5};
  const auto result = apply_update(*scene, {animated("slide", 1.0), MoveInstance{1, elsewhere}, weights,
                                            ReplaceVertices{0, {Vec3f(9.F)}, ids, UpdateMode::kAuto}});
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result->scene->version(), 2U);
  EXPECT_EQ(result->scene->instance(1).transform.world_from_object(), elsewhere);
  EXPECT_EQ(result->scene->blas(0).mesh().positions[5], Vec3f(9.F));
  EXPECT_NE(result->scene->blas(0).mesh().positions[6], scene->blas(0).mesh().positions[6]);
  ASSERT_EQ(result->report.poses.size(), 2U);
  EXPECT_TRUE(result->report.poses[0].meshes.empty());
  ASSERT_EQ(result->report.poses[1].meshes.size(), 1U);
  EXPECT_EQ(result->report.poses[1].meshes[0].action, result->report.meshes.at(0).action);
  EXPECT_GT(result->report.poses[1].meshes[0].cost_before, 0.0);
}

TEST(Pose, normals_are_turned_with_the_surface_not_made_anew) {
  SceneData data = puppet();
  mesh::TriangleMesh torus = *data.meshes[0];
  torus.normals.assign(torus.positions.size(), Vec3f(0.F, 0.F, 1.F));
  data.meshes[0] = test::share(std::move(torus));
  const auto scene = built(data);
  SetPose turn;
  turn.nodes = {{0U, TrsParts{std::nullopt, std::array<double, 4>{1, 0, 0, 1}, std::nullopt}}};
  const auto turned = posed(*scene, turn);
  for (const Vec3f& normal : turned->blas(0).mesh().normals)
    ASSERT_LT(max_abs(normal - Vec3f(0.F, -1.F, 0.F)), 1e-6F);
}

TEST(Pose, an_animation_may_squeeze_an_instance_to_nothing_and_back) {
  const auto scene = built(puppet());
  const auto gone = apply_update(*scene, {animated("vanish", 1.0)});
  ASSERT_TRUE(gone.ok());
  EXPECT_EQ(gone->report.poses.at(0).inactive_instances, 2U);
  EXPECT_FALSE(gone->scene->instance(1).transform.active());
  EXPECT_TRUE(gone->scene->validate().ok());
  EXPECT_TRUE(posed(*gone->scene, SetPose{})->instance(1).transform.active());
}

TEST(Pose, what_cannot_be_is_refused_with_its_place_and_nothing_changes) {
  const auto scene = built(puppet());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Affine flat{Mat3d(1, 0, 0, 0, 0, 0, 0, 0, 1), Vec3d(0.0)};
  const auto refused = [&](const SetPose& edit) {
    const auto result = apply_update(*scene, {MoveInstance{3, Affine{}}, edit});
    EXPECT_FALSE(result.ok());
    return result ? "" : result.error().where;
  };
  const auto node = [](ElementRef ref, std::variant<Affine, TrsParts> to) {
    SetPose edit;
    edit.nodes = {{0U, Affine{}}, {std::move(ref), to}};
    return edit;
  };
  const auto skin = [](ElementRef ref, std::vector<Affine> joints) {
    SetPose edit;
    edit.skins = {{std::move(ref), std::move(joints)}};
    return edit;
  };
  const auto weights = [](std::uint32_t mesh, std::vector<double> values) {
    SetPose edit;
    edit.weights = {{mesh, std::move(values)}};
    return edit;
  };
  EXPECT_EQ(refused(animated("run", 0.0)), "/edits/1/animation");
  EXPECT_EQ(refused(animated(3U, 0.0)), "/edits/1/animation_id");
  EXPECT_EQ(refused(animated("wave", nan)), "/edits/1/time_s");
  EXPECT_EQ(refused(animated("wave", kInfinity, AnimationWrap::kLoop)), "/edits/1/time_s");
  EXPECT_EQ(refused(node("leg", Affine{})), "/edits/1/nodes/1/node");
  EXPECT_EQ(refused(node("box", Affine{})), "/edits/1/nodes/1/node");  // two of that name
  EXPECT_EQ(refused(node(6U, Affine{})), "/edits/1/nodes/1/node_id");
  EXPECT_EQ(refused(node(0U, Affine{})), "/edits/1/nodes/1");
  EXPECT_EQ(refused(node(1U, flat)), "/edits/1/nodes/1/transform");
  EXPECT_EQ(refused(node(1U, Affine{Mat3d(1.0), Vec3d(nan)})), "/edits/1/nodes/1/transform");
  EXPECT_EQ(refused(node(1U, TrsParts{std::nullopt, std::array<double, 4>{}, std::nullopt})),
            "/edits/1/nodes/1/rotation");
  EXPECT_EQ(refused(node(1U, TrsParts{std::nullopt, std::nullopt, Vec3d(1.0, 0.0, 1.0)})),
            "/edits/1/nodes/1");
  EXPECT_EQ(refused(node(1U, Affine{Mat3d(1.0), Vec3d(1e25)})), "/edits/1/nodes");
  EXPECT_EQ(refused(skin("tail", {})), "/edits/1/skins/0/skin");
  EXPECT_EQ(refused(skin(1U, {})), "/edits/1/skins/0/skin_id");
  EXPECT_EQ(refused(skin(0U, {Affine{}})), "/edits/1/skins/0/joint_matrices");
  EXPECT_EQ(refused(skin(0U, {Affine{}, flat})), "/edits/1/skins/0/joint_matrices/1");
  EXPECT_EQ(refused(skin(0U, {Affine{Mat3d(1.0), Vec3d(0.0, nan, 0.0)}, Affine{}})),
            "/edits/1/skins/0/joint_matrices/0");
  EXPECT_EQ(refused(skin(0U, {Affine{Mat3d(1.0), Vec3d(1e20)}, Affine{}})), "/edits/1/skins");
  EXPECT_EQ(refused(weights(1, {})), "/edits/1/weights/0/mesh_id");
  EXPECT_EQ(refused(weights(7, {})), "/edits/1/weights/0/mesh_id");
  EXPECT_EQ(refused(weights(0, {1.0})), "/edits/1/weights/0/weights");
  EXPECT_EQ(refused(weights(0, {1.0, nan})), "/edits/1/weights/0/weights/1");
  EXPECT_EQ(refused(weights(0, {1.0, 1e30})), "/edits/1/weights/0");
  EXPECT_EQ(scene->version(), 1U);
  EXPECT_TRUE(scene->validate().ok());
}

TEST(Pose, unknown_animations_are_answered_with_those_that_exist) {
  const auto scene = built(puppet());
  const auto result = apply_update(*scene, {animated("run", 0.0)});
  ASSERT_FALSE(result.ok());
  EXPECT_NE(result.error().message.find("wave, slide, vanish"), std::string::npos) << result.error().message;
  const auto still = built(meshes_only());
  EXPECT_NE(apply_update(*still, {animated(0U, 0.0)}).error().message.find("has none"), std::string::npos);
}

TEST(Pose, data_are_flat_when_their_rest_pose_bends_nothing) {
  EXPECT_TRUE(is_flat(meshes_only()));
  EXPECT_FALSE(is_flat(puppet()));
  EXPECT_TRUE(is_flat(flattened(*built(puppet()))));
  SceneData morphed = puppet();
  morphed.instances[0].skin_id = kInvalidId;
  EXPECT_TRUE(is_flat(morphed));
  morphed.nodes[3].weights = {0.F, 0.5F};
  EXPECT_FALSE(is_flat(morphed));
}

// Frame after frame, each structure answers as one that is built of the same vertices.
TEST(Pose, a_hundred_frames_answer_like_scenes_built_anew_in_every_structure) {
  const std::uint64_t seed = test::seed_or(2026);
  for (const auto kind :
       {blas::StructureKind::kAuto, blas::StructureKind::kBruteForce, blas::StructureKind::kBvh,
        blas::StructureKind::kWideBvh, blas::StructureKind::kCompactBvh, blas::StructureKind::kKdTree,
        blas::StructureKind::kEmbree}) {
    SCOPED_TRACE(std::string(to_string(kind)));
    test::Random random(seed);
    SceneBuildOptions options;
    options.blas.kind = kind;
    auto scene = built(puppet(), options);
    std::size_t hits = 0;
    for (int frame = 0; frame < 100; ++frame) {
      SetPose edit = animated(frame % 7 == 6 ? "slide" : "wave", 0.021 * frame);
      edit.base = frame % 3 == 0 ? PoseBase::kRest : PoseBase::kPresent;
      scene = posed(*scene, edit);
      ASSERT_NE(scene, nullptr);
      const auto anew = built(flattened(*scene), options);
      for (int i = 0; i < 60; ++i) {
        const Ray ray = random_ray(*scene, random);
        const auto hit = intersect(*scene, ray);
        hits += hit.status == RayStatus::kHit ? 1 : 0;
        ASSERT_TRUE(same(hit, intersect(*anew, ray))) << "frame " << frame;
      }
    }
    EXPECT_GT(hits, 1000U);
    EXPECT_TRUE(scene->validate().ok());
  }
}

}  // namespace
}  // namespace gridcast::scene
