// Masks and names of instances: what changes, what stays, and which version sees it.

#include "core/scene/scene_state.h"
#include "core/scene/update.h"
#include "tests/support/puppet.h"
#include "tests/support/same_scene.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

Affine at(double x) {
  return {Mat3d(1.0), Vec3d(x, 0.0, 0.0)};
}

/// `count` boxes side by side, 4 apart.
std::shared_ptr<const Scene> boxes(std::size_t count) {
  SceneData data = meshes_only();
  for (std::size_t i = 0; i < count; ++i) place(data, 2, at(4.0 * double(i)));
  return built(std::move(data));
}

std::shared_ptr<const Scene> updated(const Scene& scene, const std::vector<SceneEdit>& edits) {
  auto result = apply_update(scene, edits);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message + result.error().where);
  return result.ok() ? result->scene : nullptr;
}

ChangeInstance masked(std::uint32_t id, InstanceMask mask) {
  return {id, std::nullopt, mask, std::nullopt};
}
ChangeInstance named(std::uint32_t id, const std::string& name) {
  return {id, std::nullopt, std::nullopt, name};
}

RayStatus seen_at(const Scene& scene, double x, InstanceMask query) {
  return intersect(scene, {{x, 0.1, 9.0}, {0, 0, -1}}, Precision::kRobust, {}, query).status;
}

TEST(ChangeInstance, a_mask_decides_who_sees_it_and_the_old_version_keeps_the_old_one) {
  const auto first = boxes(40);
  EXPECT_EQ(first->instance(3).mask, kFullMask);
  const auto second = updated(*first, {masked(3, 0x06)});
  const auto third = updated(*second, {masked(3, 0)});
  EXPECT_EQ(second->version(), 2U);
  for (int bit = 0; bit < 8; ++bit) {
    const auto query = InstanceMask(1 << bit);
    EXPECT_EQ(seen_at(*first, 12.0, query), RayStatus::kHit);
    EXPECT_EQ(seen_at(*second, 12.0, query), bit == 1 || bit == 2 ? RayStatus::kHit : RayStatus::kMiss);
    EXPECT_EQ(seen_at(*third, 12.0, query), RayStatus::kMiss);
    EXPECT_EQ(seen_at(*third, 16.0, query), RayStatus::kHit) << "the neighbour is not meant";
  }
  EXPECT_EQ(seen_at(*third, 12.0, kFullMask), RayStatus::kMiss);
  EXPECT_EQ(third->instance_count(), 40U);
  EXPECT_TRUE(third->validate());
  EXPECT_EQ(seen_at(*updated(*third, {masked(3, 0xFF)}), 12.0, 0x80), RayStatus::kHit);
}

TEST(ChangeInstance, a_mask_leaves_the_top_level_alone) {
  const auto first = boxes(300);
  const auto second = updated(*first, {masked(70, 1)});
  for (std::size_t i = 0; i < 300; i += tlas::BoxTable::kChunkSize)
    EXPECT_TRUE(second->top_level().boxes().shares_chunk(first->top_level().boxes(), i));
  EXPECT_EQ(second->bounds().lower, first->bounds().lower);
}

TEST(ChangeInstance, moves_and_poses_keep_masks_and_names) {
  const auto first = boxes(96);
  std::vector<SceneEdit> edits{named(5, "five")};
  for (std::uint32_t id = 0; id < 96; ++id) edits.emplace_back(masked(id, InstanceMask(id)));
  const auto scene = updated(*first, edits);
  MoveInstances all, some;
  for (std::uint32_t id = 0; id < 96; ++id) all.moves.push_back({id, at(4.0 * id + 1.0)});
  for (std::uint32_t id = 6; id < 96; id += 7)
    some.moves.insert(some.moves.begin(), {id, at(4.0 * id - 1.0)});
  for (const SceneEdit& move : {SceneEdit(all), SceneEdit(some), SceneEdit(MoveInstance{5, at(-9.0)})}) {
    const auto moved = updated(*scene, {move});
    for (std::uint32_t id = 0; id < 96; ++id) ASSERT_EQ(moved->instance(id).mask, id);
    EXPECT_EQ(moved->instance_name(5), "five");
  }
  const auto puppet = updated(*build_scene(test::puppet()).value(), {masked(0, 9), named(0, "waver")});
  const auto posed = updated(*puppet, {test::waving()});
  EXPECT_EQ(posed->instance(0).mask, 9U);
  EXPECT_EQ(posed->instance_name(0), "waver");
}

TEST(ChangeInstance, changes_what_is_given_and_nothing_else) {
  const auto first = updated(*boxes(3), {AddInstance{2, at(40.0), "added", 0x0C}});
  EXPECT_EQ(first->instance(3).mask, 0x0C);
  const auto place_of_it = [](const Scene& scene) { return scene.instance(3).transform.world_from_object(); };
  const auto second = updated(*first, {ChangeInstance{3, at(50.0), std::nullopt, std::nullopt}});
  EXPECT_EQ(place_of_it(*second), at(50.0));
  EXPECT_EQ(second->instance(3).mask, 0x0C);
  EXPECT_EQ(second->instance_name(3), "added");
  EXPECT_EQ(seen_at(*second, 50.0, 4), RayStatus::kHit);
  const auto third = updated(*second, {named(3, "renamed"), named(1, "one")});
  EXPECT_EQ(place_of_it(*third), at(50.0));
  EXPECT_EQ(third->instance_name(3), "renamed");
  EXPECT_EQ(third->instance_name(1), "one") << "a name of the file changes too";
  EXPECT_EQ(third->instance_name(0), "");
  EXPECT_EQ(second->instance_name(3), "added") << "the version before keeps its name";
  EXPECT_EQ(second->instance_name(1), "");
  const auto fourth = updated(*third, {ChangeInstance{3, at(60.0), InstanceMask(1), ""}});
  EXPECT_EQ(fourth->instance_name(3), "");
  EXPECT_EQ(seen_at(*fourth, 60.0, 1), RayStatus::kHit);
  EXPECT_EQ(fourth->instance_name(1), "one");
  EXPECT_GT(third->memory_bytes(), second->memory_bytes());
}

TEST(ChangeInstance, what_is_wrong_is_named_and_nothing_changes) {
  const auto scene = updated(*boxes(4), {RemoveInstance{2}});
  const auto refused = [&](const ChangeInstance& edit) {
    const auto result = apply_update(*scene, {masked(0, 1), edit});
    return result.ok() ? std::string("ok") : result.error().where;
  };
  EXPECT_EQ(refused(masked(4, 1)), "/edits/1/instance_id");
  EXPECT_EQ(refused(masked(2, 1)), "/edits/1/instance_id") << "a removed one";
  EXPECT_EQ(refused({1, Affine{Mat3d(0.0), {}}, InstanceMask(3), "x"}), "/edits/1/world_from_object");
  EXPECT_EQ(scene->instance(0).mask, kFullMask);
  EXPECT_EQ(scene->instance(1).mask, kFullMask);
  EXPECT_EQ(scene->instance_name(1), "");
}

TEST(ChangeInstance, states_and_differences_hold_masks_and_names) {
  const auto first = updated(*boxes(70), {named(1, "one"), AddInstance{2, at(-8.0), "added", 5}});
  const auto second = updated(*first, {masked(66, 0), named(70, "renamed"), named(1, "one")});
  const SceneDelta delta = difference(*first, *second);
  ASSERT_EQ(delta.instances.size(), 1U);
  EXPECT_EQ(delta.instances[0].instance_id, 66U);
  EXPECT_EQ(delta.instances[0].state.mask, 0U);
  EXPECT_EQ(delta.new_names, (std::map<std::uint32_t, std::string>{{70, "renamed"}}));
  EXPECT_TRUE(difference(*second, *updated(*second, {masked(66, 0)})).instances.empty());
  const auto restored = restore_scene(state_of(*second)).value();
  test::expect_same_scene(*second, *restored);
  EXPECT_EQ(restored->instance(66).mask, 0U);
  EXPECT_EQ(restored->instance(70).mask, 5U);
  EXPECT_EQ(restored->instance_name(70), "renamed");
  // And goes on from there.
  test::expect_same_scene(*updated(*second, {named(2, "two")}), *updated(*restored, {named(2, "two")}));
  SceneState state = state_of(*second);
  state.new_names[71] = "nobody";
  const auto wrong = restore_scene(std::move(state));
  ASSERT_FALSE(wrong.ok());
  EXPECT_EQ(wrong.error().where, "/new_names");
}

}  // namespace
}  // namespace gridcast::scene
