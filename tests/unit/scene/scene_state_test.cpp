#include "core/scene/scene_state.h"

#include <gtest/gtest.h>

#include "core/scene/trace.h"
#include "core/scene/update.h"
#include "tests/support/puppet.h"
#include "tests/support/same_scene.h"

namespace gridcast::scene {
namespace {

std::shared_ptr<const Scene> boxes(std::size_t count) {
  SceneData data;
  data.meshes = {test::share(test::box({-1, -1, -1}, {1, 1, 1}))};
  data.deformations.resize(1);
  for (std::size_t i = 0; i < count; ++i) {
    InstanceData instance;
    instance.mesh_id = 0;
    instance.world_from_object.translation = {10.0 * double(i), 0.0, 0.0};
    data.instances.push_back(instance);
  }
  return build_scene(std::move(data)).value();
}

Affine place(double x, double y) {
  Affine affine;
  affine.translation = {x, y, 0.0};
  return affine;
}

TEST(SceneState, restores_version_ids_names_and_answers) {
  const auto first = boxes(3);
  std::vector<SceneEdit> edits{AddInstance{0, place(-10.0, 0.25), "added"}, RemoveInstance{1},
                               ReplaceVertices{0, {{-1.F, -3.F, -1.F}}, {0}, UpdateMode::kAuto}};
  const auto second = apply_update(*first, edits).value().scene;
  const auto restored = restore_scene(state_of(*second)).value();
  EXPECT_TRUE(restored->validate());
  EXPECT_EQ(restored->version(), 2U);
  EXPECT_EQ(restored->instance_slots(), 4U);
  EXPECT_FALSE(restored->find_instance(1));
  EXPECT_EQ(restored->instance_name(3), "added");
  EXPECT_EQ(restored->world_triangle_count(), second->world_triangle_count());
  for (int i = -12; i < 24; ++i) {
    const Ray ray{{double(i), 0.1, 100.0}, {0.001, 0.002, -1.0}};
    const SurfaceHit a = intersect(*second, ray), b = intersect(*restored, ray);
    EXPECT_EQ(a.status, b.status);
    EXPECT_EQ(a.t, b.t);
    EXPECT_EQ(a.instance_id, b.instance_id);
    EXPECT_EQ(a.primitive_id, b.primitive_id);
  }
}

TEST(SceneState, a_difference_names_what_changed_and_nothing_else) {
  const auto first = boxes(200);
  const auto second =
      apply_update(*first, {MoveInstance{70, place(1.0, 2.0)}, AddInstance{0, place(3.0, 4.0), "new"}})
          .value()
          .scene;
  const SceneDelta delta = difference(*first, *second);
  EXPECT_EQ(delta.version, 2U);
  ASSERT_EQ(delta.instances.size(), 2U);
  EXPECT_EQ(delta.instances[0].instance_id, 70U);
  EXPECT_EQ(delta.instances[1].instance_id, 200U);
  ASSERT_EQ(delta.added_names.size(), 1U);
  EXPECT_TRUE(delta.meshes.empty());
  EXPECT_TRUE(difference(*first, *first).instances.empty());
}

TEST(SceneState, restores_the_pose_and_goes_on_from_it) {
  const auto rest = build_scene(test::puppet()).value();
  const auto posed = apply_update(*rest, {test::waving(), test::stretched()}).value().scene;
  const auto restored = restore_scene(state_of(*posed)).value();
  EXPECT_TRUE(restored->validate());
  test::expect_same_scene(*posed, *restored);
  SetPose next;
  next.base = PoseBase::kPresent;
  next.nodes = {{1U, TrsParts{Vec3d(0.0, 0.4, 0.0), std::nullopt, std::nullopt}}};
  test::expect_same_scene(*apply_update(*posed, {next}).value().scene,
                          *apply_update(*restored, {next}).value().scene);
}

TEST(SceneState, a_difference_holds_a_pose_and_its_nodes_only_where_they_changed) {
  const auto rest = build_scene(test::puppet()).value();
  const auto waving = apply_update(*rest, {test::waving()}).value().scene;
  const auto stretched = apply_update(*waving, {test::stretched()}).value().scene;
  const auto moved = apply_update(*stretched, {MoveInstance{1, place(1.0, 2.0)}}).value().scene;
  ASSERT_TRUE(difference(*rest, *waving).pose);
  EXPECT_NE(difference(*rest, *waving).pose->nodes, nullptr);
  ASSERT_TRUE(difference(*waving, *stretched).pose);
  EXPECT_EQ(difference(*waving, *stretched).pose->nodes, nullptr);
  EXPECT_EQ(difference(*waving, *stretched).pose->joints, stretched->pose().joints);
  EXPECT_FALSE(difference(*stretched, *moved).pose);
}

TEST(SceneState, refuses_a_pose_of_another_file) {
  const auto scene = build_scene(test::puppet()).value();
  const auto refused = [&](const auto& change) {
    SceneState state = state_of(*scene);
    Pose pose = *state.pose;
    change(pose);
    state.pose = std::make_shared<const Pose>(std::move(pose));
    const auto restored = restore_scene(std::move(state));
    return !restored && restored.error().where == "/pose";
  };
  EXPECT_TRUE(refused([](Pose& pose) { pose.nodes = nullptr; }));
  EXPECT_TRUE(refused([](Pose& pose) { pose.nodes = std::make_shared<NodePoses>(); }));
  EXPECT_TRUE(refused([](Pose& pose) { pose.weights[0].push_back(1.0); }));
  EXPECT_TRUE(refused([](Pose& pose) { pose.joints[1] = {Affine{}}; }));
  EXPECT_TRUE(refused([](Pose& pose) { pose.animation = AnimationMoment{1, 0.0}; }));
  EXPECT_FALSE(refused([](Pose&) {}));
}

TEST(SceneState, refuses_a_state_that_no_scene_can_have) {
  const auto scene = boxes(2);
  SceneState state = state_of(*scene);
  state.instances[1].mesh_id = 1;
  const auto restored = restore_scene(std::move(state));
  ASSERT_FALSE(restored);
  EXPECT_EQ(restored.error().where, "/instances/1/mesh_id");
}

}  // namespace
}  // namespace gridcast::scene
