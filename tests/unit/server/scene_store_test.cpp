#include "server/scene_store.h"

#include <atomic>
#include <thread>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

std::shared_ptr<const scene::Scene> two_boxes() {
  scene::SceneData data;
  data.meshes = {test::share(test::box({-1, -1, -1}, {1, 1, 1}))};
  data.deformations.resize(1);
  for (const double x : {0.0, 10.0}) {
    scene::InstanceData instance;
    instance.mesh_id = 0;
    instance.world_from_object.translation = {x, 0.0, 0.0};
    data.instances.push_back(instance);
  }
  return build_scene(std::move(data)).value();
}

std::vector<scene::SceneEdit> move_both(double y) {
  std::vector<scene::SceneEdit> edits;
  for (std::uint32_t id = 0; id < 2; ++id) {
    Affine place;
    place.translation = {10.0 * id, y, 0.0};
    edits.emplace_back(scene::MoveInstance{id, place});
  }
  return edits;
}

ProblemCode code_of(const std::optional<Problem>& problem) {
  return problem ? problem->code : ProblemCode::kInternal;
}

TEST(IfMatch, names_the_version_or_everything_or_is_absent) {
  EXPECT_FALSE(check_if_match("", 7));
  EXPECT_FALSE(check_if_match("*", 7));
  EXPECT_FALSE(check_if_match("\"7\"", 7));
  EXPECT_FALSE(check_if_match("\"6\", \"7\"", 7));
  EXPECT_EQ(code_of(check_if_match("\"6\"", 7)), ProblemCode::kVersionMismatch);
  EXPECT_EQ(code_of(check_if_match("W/\"7\"", 7)), ProblemCode::kVersionMismatch);
  EXPECT_EQ(code_of(check_if_match("7", 7)), ProblemCode::kInvalidHeader);
}

TEST(SceneStore, makes_names_and_refuses_taken_ones) {
  SceneStore store(3);
  const auto scene = two_boxes();
  EXPECT_EQ(std::get<0>(store.create("", scene, {}))->id(), "s1");
  EXPECT_EQ(std::get<0>(store.create("s2", scene, {}))->id(), "s2");
  EXPECT_EQ(std::get<Problem>(store.create("s2", scene, {})).code, ProblemCode::kNameTaken);
  EXPECT_EQ(std::get<0>(store.create("", scene, {}))->id(), "s3");
  EXPECT_EQ(std::get<Problem>(store.create("", scene, {})).code, ProblemCode::kTooManyScenes);
  EXPECT_EQ(store.list().size(), 3U);
}

TEST(SceneStore, ids_are_plain_words) {
  EXPECT_TRUE(SceneStore::is_valid_id("a_B-9.glb"));
  for (const char* id : {"", ".", "..", "a/b", "a b", "\xc3\xa4"})
    EXPECT_FALSE(SceneStore::is_valid_id(id)) << id;
  EXPECT_FALSE(SceneStore::is_valid_id(std::string(65, 'a')));
}

TEST(SceneStore, a_scene_goes_only_at_the_version_that_was_named) {
  SceneStore store(3);
  const auto named = std::get<0>(store.create("a", two_boxes(), {}));
  ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(named->update("\"1\"", move_both(1.0))));
  EXPECT_EQ(code_of(store.erase("a", "\"1\"")), ProblemCode::kVersionMismatch);
  EXPECT_FALSE(store.erase("a", "\"2\""));
  EXPECT_EQ(code_of(store.erase("a", "")), ProblemCode::kSceneNotFound);
}

TEST(NamedScene, a_refused_update_leaves_the_old_version) {
  SceneStore store(1);
  const auto named = std::get<0>(store.create("a", two_boxes(), {}));
  const auto before = named->snapshot();
  EXPECT_TRUE(std::holds_alternative<Problem>(named->update("\"9\"", move_both(1.0))));
  EXPECT_TRUE(std::holds_alternative<Error>(named->update("", {scene::RemoveInstance{5}})));
  EXPECT_EQ(named->snapshot(), before);
}

TEST(NamedScene, readers_never_see_half_an_update) {
  SceneStore store(1);
  const auto named = std::get<0>(store.create("a", two_boxes(), {}));
  std::atomic<bool> done{false};
  std::atomic<int> torn{0};
  std::thread reader([&] {
    while (!done) {
      const auto scene = named->snapshot();
      const double first = scene->instance(0).transform.world_from_object().translation.y;
      const double second = scene->instance(1).transform.world_from_object().translation.y;
      // The y of version v is v - 1, in both instances.
      if (first != second || first != double(scene->version() - 1)) ++torn;
    }
  });
  for (int i = 1; i <= 200; ++i)
    ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(named->update("", move_both(double(i)))));
  done = true;
  reader.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(named->snapshot()->version(), 201U);
}

TEST(NamedScene, of_two_writers_at_the_same_version_one_wins) {
  SceneStore store(1);
  const auto named = std::get<0>(store.create("a", two_boxes(), {}));
  std::atomic<int> won{0};
  const auto write = [&] {
    if (std::holds_alternative<scene::UpdateResult>(named->update("\"1\"", move_both(1.0)))) ++won;
  };
  std::thread other(write);
  write();
  other.join();
  EXPECT_EQ(won, 1);
}

}  // namespace
}  // namespace gridcast::server
