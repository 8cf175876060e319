// What a scene keeps of its past: versions by number, and the updates that led to them.

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "core/scene/tree_replacement.h"
#include "proto/transaction.h"
#include "server/routes/edit_lines.h"
#include "server/scene_store.h"
#include "tests/support/shapes.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

std::shared_ptr<const scene::Scene> box_scene() {
  scene::SceneData data;
  data.meshes = {test::share(test::box({-1, -1, -1}, {1, 1, 1}))};
  data.deformations.resize(1);
  scene::InstanceData instance;
  instance.mesh_id = 0;
  data.instances = {instance};
  return build_scene(std::move(data)).value();
}

scene::SceneEdit move_to(double x) {
  Affine place;
  place.translation.x = x;
  return scene::MoveInstance{0, place};
}

constexpr std::size_t kPlenty = std::size_t(1) << 20;

struct SceneHistory : ::testing::Test {
  static std::shared_ptr<NamedScene> scene(SceneStore& store) {
    return std::get<0>(store.create("a", box_scene(), {}));
  }
  static void update_to(NamedScene& named, std::uint64_t version) {
    for (std::uint64_t v = named.snapshot()->version() + 1; v <= version; ++v)
      ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(named.update("", {move_to(double(v))})));
  }
  static ProblemCode code_at(const NamedScene& named, std::uint64_t version) {
    const auto found = named.snapshot_at(version);
    return std::holds_alternative<Problem>(found) ? std::get<Problem>(found).code : ProblemCode::kInternal;
  }
};

TEST_F(SceneHistory, the_last_versions_are_kept_and_no_more) {
  SceneStore store(1, nullptr, nullptr, {3, 0});
  const auto named = scene(store);
  std::weak_ptr<const scene::Scene> first = named->snapshot();
  update_to(*named, 3);
  EXPECT_FALSE(first.expired());
  EXPECT_EQ(std::get<0>(named->snapshot_at(1)), first.lock());
  update_to(*named, 4);
  EXPECT_TRUE(first.expired()) << "the fourth takes its place";
  EXPECT_EQ(named->live_versions(), 3U);
  for (std::uint64_t version = 2; version <= 4; ++version) {
    const auto found = std::get<0>(named->snapshot_at(version));
    EXPECT_EQ(found->version(), version);
    EXPECT_EQ(found->instance(0).transform.world_from_object().translation.x, double(version));
  }
  EXPECT_EQ(code_at(*named, 1), ProblemCode::kVersionGone);
  EXPECT_EQ(std::get<Problem>(named->snapshot_at(1)).detail, "versions 2 to 4 are kept");
  EXPECT_EQ(code_at(*named, 0), ProblemCode::kVersionGone);
  EXPECT_EQ(code_at(*named, 5), ProblemCode::kVersionNotFound);
}

TEST_F(SceneHistory, with_one_kept_an_old_version_goes_at_once) {
  SceneStore store(1);
  const auto named = scene(store);
  update_to(*named, 2);
  EXPECT_EQ(named->live_versions(), 1U);
  EXPECT_EQ(code_at(*named, 1), ProblemCode::kVersionGone);
  EXPECT_EQ(std::get<0>(named->snapshot_at(2)), named->snapshot());
}

TEST_F(SceneHistory, a_better_tree_takes_the_place_of_its_version) {
  SceneStore store(1, nullptr, nullptr, {2, 0});
  scene::SceneData data;
  data.meshes.push_back(test::share(test::icosphere(3)));
  data.deformations.resize(1);
  data.instances.resize(1);
  data.instances[0].mesh_id = 0;
  scene::SceneBuildOptions options;
  options.blas.kind = blas::StructureKind::kWideBvh;
  const auto named = std::get<0>(store.create("a", build_scene(std::move(data), options).value(), {}));
  // Refitted to vertices that have nothing to do with its shape the tree is bad.
  scene::ReplaceVertices shuffle{
      0, named->snapshot()->blas(0).mesh().positions, {}, scene::UpdateMode::kRefit};
  std::mt19937_64 engine(1);
  std::ranges::shuffle(shuffle.positions, engine);
  ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(named->update("", {shuffle})));
  auto before = named->snapshot();
  const auto tree = blas::Blas::build(before->blas(0).mesh_ptr(), before->blas_options()).value();
  const auto refused = named->replace_tree(0, tree, {});
  ASSERT_TRUE(refused.ok() && !*refused);
  EXPECT_NE(named->snapshot(), before);
  EXPECT_EQ(std::get<0>(named->snapshot_at(2)), named->snapshot());
  EXPECT_EQ(std::get<0>(named->snapshot_at(1))->version(), 1U);
  EXPECT_EQ(named->live_versions(), 3U);
  before.reset();
  EXPECT_EQ(named->live_versions(), 2U) << "the one with the bad tree is not kept";
}

TEST_F(SceneHistory, giving_up_leaves_the_newest_version_alone) {
  SceneStore store(2, nullptr, nullptr, {4, kPlenty});
  const auto named = scene(store);
  update_to(*named, 6);
  EXPECT_EQ(named->kept().oldest, 3U);
  EXPECT_EQ(named->kept().log_since, 1U);
  EXPECT_GT(named->kept().log_bytes, 5 * sizeof(scene::SceneEdit));
  store.drop_history();
  EXPECT_EQ(named->live_versions(), 1U);
  EXPECT_EQ(named->kept().oldest, 6U);
  EXPECT_EQ(named->kept().log_since, 6U);
  EXPECT_EQ(named->kept().log_bytes, 0U);
  update_to(*named, 7);
  EXPECT_EQ(named->kept().oldest, 6U);
  EXPECT_EQ(std::get<NamedScene::LogPart>(named->log_after(6, 10)).lines.size(), 1U);
}

TEST_F(SceneHistory, the_log_tells_what_came_after_a_version) {
  SceneStore store(1, nullptr, nullptr, {1, kPlenty});
  const auto named = scene(store);
  update_to(*named, 9);
  const auto part = std::get<NamedScene::LogPart>(named->log_after(4, 3));
  EXPECT_EQ(part.newest, 9U);
  ASSERT_EQ(part.lines.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(part.lines[i].version, 5 + i);
    ASSERT_EQ(part.lines[i].edits->size(), 1U);
    const auto& move = std::get<scene::MoveInstance>(part.lines[i].edits->front());
    EXPECT_EQ(move.world_from_object.translation.x, double(5 + i));
  }
  EXPECT_TRUE(std::get<NamedScene::LogPart>(named->log_after(9, 3)).lines.empty());
  EXPECT_EQ(std::get<NamedScene::LogPart>(named->log_after(1, 100)).lines.size(), 8U);
  EXPECT_EQ(std::get<Problem>(named->log_after(10, 3)).code, ProblemCode::kVersionNotFound);
  EXPECT_EQ(std::get<Problem>(named->log_after(0, 3)).code, ProblemCode::kLogGone);
}

TEST_F(SceneHistory, what_was_refused_is_not_in_the_log) {
  SceneStore store(1, nullptr, nullptr, {1, kPlenty});
  const auto named = scene(store);
  EXPECT_TRUE(std::holds_alternative<Error>(named->update("", {move_to(1), scene::RemoveInstance{9}})));
  EXPECT_TRUE(std::holds_alternative<Problem>(named->update("\"9\"", {move_to(1)})));
  EXPECT_TRUE(std::get<NamedScene::LogPart>(named->log_after(1, 3)).lines.empty());
}

TEST_F(SceneHistory, the_log_keeps_the_edits_themselves) {
  SceneStore store(1, nullptr, nullptr, {1, kPlenty});
  const auto named = scene(store);
  const auto edits = std::make_shared<const std::vector<scene::SceneEdit>>(1, move_to(2));
  ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(named->update("", edits)));
  EXPECT_EQ(std::get<NamedScene::LogPart>(named->log_after(1, 3)).lines.at(0).edits, edits);
}

LogLine vertices_line(std::uint64_t version, std::size_t count) {
  scene::ReplaceVertices edit;
  edit.positions.resize(count);
  return {version, std::make_shared<const std::vector<scene::SceneEdit>>(1, scene::SceneEdit(edit))};
}

TEST(SceneLog, the_oldest_lines_go_when_the_bytes_are_used_up) {
  const std::size_t one = vertices_line(1, 1000).bytes;
  EXPECT_GE(one, 1000 * sizeof(Vec3f));
  EXPECT_LE(one, 1000 * sizeof(Vec3f) + 1000);
  SceneLog log(1, 3 * one);
  for (std::uint64_t version = 2; version <= 4; ++version)
    EXPECT_TRUE(log.add(vertices_line(version, 1000)).empty());
  EXPECT_EQ(log.since(), 1U);
  EXPECT_EQ(log.bytes(), 3 * one);
  EXPECT_EQ(log.add(vertices_line(5, 1000)).size(), 1U);
  EXPECT_EQ(log.since(), 2U);
  EXPECT_EQ(log.after(2, 9).front().version, 3U);
  EXPECT_EQ(log.add(vertices_line(6, 4000)).size(), 4U) << "it is too large itself, and the last";
  EXPECT_EQ(log.since(), 6U);
  EXPECT_EQ(log.bytes(), 0U);
}

TEST(SceneLog, what_no_transaction_can_hold_ends_it) {
  SceneLog log(1, kPlenty);
  log.add(vertices_line(2, 10));
  const scene::AddMesh mesh{test::share(test::box({0, 0, 0}, {1, 1, 1}))};
  log.add({3, std::make_shared<const std::vector<scene::SceneEdit>>(1, scene::SceneEdit(mesh))});
  EXPECT_EQ(log.since(), 3U);
  log.add(vertices_line(4, 10));
  EXPECT_EQ(log.after(3, 9).size(), 1U);
}

TEST(SceneLog, every_kind_of_edit_is_written_as_transactions_take_it) {
  scene::SetPose pose;
  pose.base = scene::PoseBase::kPresent;
  pose.mode = scene::UpdateMode::kRefit;
  pose.animation = scene::AnimationTime{std::string("run"), 0.25, scene::AnimationWrap::kLoop};
  pose.nodes = {{2U, Affine()}, {std::string("hip"), scene::TrsParts{Vec3d(1, 2, 3), {}, Vec3d(4, 5, 6)}}};
  pose.skins = {{0U, {Affine()}}};
  pose.weights = {{1, {0.5}}};
  scene::ReplaceVertices vertices{3, {{1, 2, 3}}, {4}, scene::UpdateMode::kRebuild};
  const scene::MoveInstances moves{{{5, Affine()}, {6, Affine()}}};
  const auto edits = std::make_shared<const std::vector<scene::SceneEdit>>(std::vector<scene::SceneEdit>{
      scene::AddInstance{1, Affine(), "x"}, scene::RemoveInstance{2}, move_to(3), moves, vertices, pose});
  proto::LogWriter log;
  write_line({4, edits}, log);
  const std::string identity = R"([[1,0,0,0],[0,1,0,0],[0,0,1,0]])";
  EXPECT_EQ(std::move(log).take(),
            R"({"version":4,"edits":[{"op":"add_instance","mesh_id":1,"transform":)" + identity +
                R"(,"name":"x"},{"op":"remove_instance","instance_id":2},)"
                R"({"op":"move_instance","instance_id":0,"transform":[[1,0,0,3],[0,1,0,0],[0,0,1,0]]},)"
                R"({"op":"move_instance","instance_id":5,"transform":)" +
                identity + R"(},{"op":"move_instance","instance_id":6,"transform":)" + identity +
                R"(},{"op":"replace_vertices","mesh_id":3,"positions":[[1,2,3]],"vertex_ids":[4],)"
                R"("update":"rebuild"},{"op":"set_pose","base":"present","animation":"run","time_s":0.25,)"
                R"("wrap":"loop","nodes":[{"node_id":2,"transform":)" +
                identity + R"(},{"node":"hip","translation":[1,2,3],"scale":[4,5,6]}],)" +
                R"("skins":[{"skin_id":0,"joint_matrices":[)" + identity +
                R"(]}],"weights":[{"mesh_id":1,"weights":[0.5]}],"update":"refit"}]})" + "\n");
}

}  // namespace
}  // namespace gridcast::server
