// Many moves in one edit: the same as one edit each, but for the time.

#include <numeric>

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include "core/scene/update.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

/// `count` of the instances that are there, in any order.
std::vector<MoveInstance> random_moves(const Scene& scene, std::size_t count, test::Random& random) {
  std::vector<std::uint32_t> ids(scene.instance_slots());
  std::iota(ids.begin(), ids.end(), 0U);
  std::erase_if(ids, [&](std::uint32_t id) { return !scene.find_instance(id); });
  for (std::size_t i = ids.size(); i > 1; --i) std::swap(ids[i - 1], ids[random.below(std::uint32_t(i))]);
  ids.resize(count);
  if (random.below(2) == 0) std::sort(ids.begin(), ids.end());
  std::vector<MoveInstance> moves;
  for (const std::uint32_t id : ids) moves.push_back({id, random_affine(random, 8.0, 0.5)});
  return moves;
}

std::vector<SceneEdit> one_by_one(const std::vector<MoveInstance>& moves) {
  return {moves.begin(), moves.end()};
}

std::shared_ptr<const Scene> updated(const Scene& scene, const std::vector<SceneEdit>& edits) {
  auto result = apply_update(scene, edits);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message + result.error().where);
  return result.ok() ? result->scene : nullptr;
}

void expect_same_scene(const Scene& a, const Scene& b, test::Random& random) {
  ASSERT_EQ(a.instance_slots(), b.instance_slots());
  for (std::uint32_t id = 0; id < a.instance_slots(); ++id) {
    const InstanceTransform &x = a.instance(id).transform, &y = b.instance(id).transform;
    ASSERT_EQ(x.world_from_object(), y.world_from_object());
    ASSERT_EQ(x.object_from_world_linear(), y.object_from_world_linear());
    ASSERT_EQ(x.condition(), y.condition());
    ASSERT_EQ(a.instance(id).mesh_id, b.instance(id).mesh_id);
    ASSERT_EQ(a.instance(id).alive, b.instance(id).alive);
    ASSERT_EQ(a.instance(id).mask, b.instance(id).mask);
    ASSERT_EQ(a.top_level().box(id), b.top_level().box(id));
  }
  for (int i = 0; i < 100; ++i) {
    const Ray ray = random_ray(a, random);
    ASSERT_TRUE(same(intersect(a, ray), intersect(b, ray)));
  }
  for (const Scene* scene : {&a, &b}) {
    const Status status = scene->validate();
    ASSERT_TRUE(status.ok()) << status.error().message << status.error().where;
  }
}

TEST(MoveInstances, answers_like_single_moves_for_any_share_and_leaves_the_old_version_alone) {
  test::Random random(test::seed_or(81));
  std::vector<SceneEdit> edits;
  for (std::uint32_t id = 0; id < 700; ++id)
    edits.emplace_back(ChangeInstance{id, {}, InstanceMask(37 * id + 1), {}});
  edits.insert(edits.end(), {RemoveInstance{5}, RemoveInstance{333}});
  const auto first = updated(*start_scene(random, 700), edits);
  for (const std::size_t count : {1U, 7U, 64U, 300U, 698U}) {
    SCOPED_TRACE(count);
    const std::vector<MoveInstance> moves = random_moves(*first, count, random);
    const auto bulk = updated(*first, {MoveInstances{moves}});
    ASSERT_NO_FATAL_FAILURE(expect_same_scene(*bulk, *updated(*first, one_by_one(moves)), random));
    EXPECT_EQ(bulk->version(), first->version() + 1);
    // Back again: what the first version said is what it says still.
    std::vector<MoveInstance> back = moves;
    for (MoveInstance& move : back)
      move.world_from_object = first->instance(move.instance_id).transform.world_from_object();
    ASSERT_NO_FATAL_FAILURE(expect_same_scene(*updated(*bulk, {MoveInstances{back}}), *first, random));
  }
}

TEST(MoveInstances, mixes_with_other_edits_in_their_order) {
  test::Random random(test::seed_or(82));
  const auto scene = start_scene(random, 300);
  std::vector<MoveInstance> moves = random_moves(*scene, 300, random);
  moves.push_back({300, random_affine(random, 8.0, 0.5)});  // added below
  const auto& old = scene->blas(2).mesh().positions;
  const ReplaceVertices grown{2, {old[3] * 1.5F}, {3}};
  const AddInstance added{1, {}, "added"};
  std::vector<SceneEdit> edits{added, MoveInstances{moves}, RemoveInstance{17}, grown,
                               MoveInstance{40, random_affine(random, 8.0, 0.5)}};
  const auto bulk = updated(*scene, edits);
  const SceneEdit last = edits.back();
  edits = one_by_one(moves);
  edits.insert(edits.begin(), added);
  edits.insert(edits.end(), {RemoveInstance{17}, grown, last});
  expect_same_scene(*bulk, *updated(*scene, edits), random);
}

TEST(MoveInstances, moves_that_hardly_are_out_of_order_are_found_so_wherever_they_stand) {
  test::Random random(test::seed_or(84));
  const auto scene = start_scene(random, 2300);
  std::vector<MoveInstance> sorted = random_moves(*scene, 2300, random);
  std::ranges::sort(sorted, {}, &MoveInstance::instance_id);
  const auto wanted = updated(*scene, {MoveInstances{sorted}});
  // Parts of several hundred moves are looked at apart: around their borders, and those of chunks.
  for (const std::size_t at : {0U, 63U, 64U, 130U, 511U, 512U, 700U, 1023U, 1024U, 1600U, 2298U}) {
    for (const std::size_t far : {1U, 2U, 66U, 513U, 1100U}) {
      if (at + far >= sorted.size()) continue;
      std::vector<MoveInstance> moves = sorted;
      moves[at + far].instance_id = moves[at].instance_id;
      const auto twice = apply_update(*scene, {MoveInstances{moves}});
      ASSERT_FALSE(twice.ok());
      ASSERT_EQ(twice.error().where, "/edits/0/moves/" + std::to_string(at + far) + "/instance_id");
      moves = sorted;
      std::swap(moves[at], moves[at + far]);
      const auto moved = updated(*scene, {MoveInstances{moves}});
      for (std::uint32_t id = 0; id < 2300; ++id) {
        ASSERT_EQ(moved->instance(id).transform.world_from_object(),
                  wanted->instance(id).transform.world_from_object());
        ASSERT_EQ(moved->top_level().box(id), wanted->top_level().box(id));
      }
    }
  }
}

// These once ran over what a chunk has room for.
TEST(MoveInstances, a_thousand_moves_of_one_instance_are_refused_by_the_second) {
  test::Random random(test::seed_or(85));
  const auto scene = start_scene(random, 100);
  for (const std::uint32_t id : {0U, 40U, 99U}) {
    std::vector<MoveInstance> moves(1000, {id, {}});
    const auto result = apply_update(*scene, {MoveInstances{moves}});
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().where, "/edits/0/moves/1/instance_id");
  }
}

TEST(MoveInstances, the_first_move_that_is_wrong_is_named_and_nothing_changes) {
  test::Random random(test::seed_or(83));
  const auto scene = updated(*start_scene(random, 400), {RemoveInstance{9}});
  const std::vector<MoveInstance> good = random_moves(*scene, 399, random);
  const auto fails = [&](const std::vector<MoveInstance>& moves, ErrorCode code, const std::string& where) {
    const auto result = apply_update(*scene, {RemoveInstance{good[0].instance_id == 3 ? 4U : 3U},
                                              MoveInstances{{}}, MoveInstances{moves}});
    ASSERT_FALSE(result.ok()) << where;
    EXPECT_EQ(result.error().code, code) << where;
    EXPECT_EQ(result.error().where, "/edits/2/moves/" + where);
  };
  std::vector<MoveInstance> only_good = good;
  std::erase_if(only_good,
                [](const MoveInstance& move) { return move.instance_id == 3 || move.instance_id == 4; });
  const auto with = [&](std::size_t at, const MoveInstance& move) {
    std::vector<MoveInstance> moves = only_good;
    moves[at] = move;
    return moves;
  };
  fails(with(200, {9, {}}), ErrorCode::kNotFound, "200/instance_id");
  fails(with(200, {400, {}}), ErrorCode::kNotFound, "200/instance_id");
  fails(with(0, {kInvalidId, {Mat3d(0.0), {}}}), ErrorCode::kNotFound, "0/instance_id");
  fails(with(300, {only_good[7].instance_id, {}}), ErrorCode::kInvalidArgument, "300/instance_id");
  fails(with(300, {only_good[300].instance_id, {Mat3d(0.0), {}}}), ErrorCode::kInvalidArgument,
        "300/world_from_object");
  std::vector<MoveInstance> both = with(120, {only_good[120].instance_id, {Mat3d(0.0), {}}});
  both[30] = {77777, {}};
  fails(both, ErrorCode::kNotFound, "30/instance_id");
  both[10].world_from_object.translation.x = std::numeric_limits<double>::quiet_NaN();
  fails(both, ErrorCode::kInvalidArgument, "10/world_from_object");
  const Status valid = scene->validate();
  EXPECT_TRUE(valid.ok()) << valid.error().message << valid.error().where;
}

TEST(MoveInstances, is_the_same_bits_on_one_to_four_threads) {
  using Control = oneapi::tbb::global_control;
  const Control allow(Control::max_allowed_parallelism, 4);
  test::Random random(test::seed_or(84));
  const auto scene = start_scene(random, 9000);
  for (const std::size_t count : {90U, 9000U}) {
    const std::vector<SceneEdit> edits{MoveInstances{random_moves(*scene, count, random)}};
    std::shared_ptr<const Scene> of_one;
    for (const int threads : {1, 2, 3, 4}) {
      std::shared_ptr<const Scene> moved;
      oneapi::tbb::task_arena(threads).execute([&] { moved = updated(*scene, edits); });
      if (!of_one) of_one = moved;
      ASSERT_NO_FATAL_FAILURE(expect_same_scene(*moved, *of_one, random));
    }
  }
}

TEST(MoveInstances, copies_no_more_chunks_than_instances_move) {
  test::Random random(test::seed_or(85));
  const auto scene = start_scene(random, 5000);
  for (const std::size_t count : {1U, 10U, 60U}) {
    const auto moved = updated(*scene, {MoveInstances{random_moves(*scene, count, random)}});
    std::size_t copied = 0;
    for (std::size_t i = 0; i < scene->instance_slots(); i += tlas::BoxTable::kChunkSize)
      copied += std::size_t(!moved->top_level().boxes().shares_chunk(scene->top_level().boxes(), i));
    EXPECT_GT(copied, 0U);
    EXPECT_LE(copied, count);
  }
}

}  // namespace
}  // namespace gridcast::scene
