#include "server/tree_builder.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <memory>
#include <thread>

#include <gtest/gtest.h>

#include "core/scene/flatten.h"
#include "core/scene/trace.h"
#include "server/scene_store.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::server {
namespace {

using Positions = std::vector<Vec3f>;

/// More triangles than are rebuilt within an update.
const mesh::TriangleMesh& large_mesh() {
  static const mesh::TriangleMesh mesh = test::icosphere(5);
  return mesh;
}

/// Each by so much that a tree is of no use, and yet so little that boxes do not crowd: such meshes get their
/// better trees from the background.
Positions scattered(Positions positions, std::uint64_t seed) {
  test::Random random(seed);
  for (Vec3f& p : positions) p += Vec3f(0.3 * random.direction());
  return positions;
}

/// The vertices of a version: now a slow twist, now a mess.
Positions positions_of(std::uint64_t version) {
  Positions positions = large_mesh().positions;
  if (version % 20 >= 14) return scattered(std::move(positions), version);
  for (Vec3f& p : positions) {
    const double angle = 0.2 * double(version % 20) * p.y, c = std::cos(angle), s = std::sin(angle);
    p = {float(c * p.x - s * p.z), p.y, float(s * p.x + c * p.z)};
  }
  return positions;
}

std::shared_ptr<const scene::Scene> scene_of(std::uint64_t version, std::size_t meshes = 1) {
  scene::SceneData data;
  for (std::uint32_t id = 0; id < meshes; ++id) {
    auto mesh = std::make_shared<mesh::TriangleMesh>(large_mesh());
    mesh->positions = positions_of(version);
    data.meshes.push_back(std::move(mesh));
    scene::InstanceData instance;
    instance.mesh_id = id;
    instance.world_from_object.translation.x = 10.0 * id;
    data.instances.push_back(instance);
  }
  data.deformations.resize(meshes);
  scene::SceneBuildOptions options;
  options.blas.quality = blas::BuildQuality::kFast;
  auto built = build_scene(std::move(data), options).value();
  return built;
}
/// As a client's model is built.
std::shared_ptr<const scene::Scene> good_scene(std::size_t meshes = 1) {
  scene::SceneData data = flattened(*scene_of(0, meshes));
  return build_scene(std::move(data)).value();
}

std::vector<scene::SceneEdit> edits_to(std::uint64_t version, std::uint32_t mesh_id = 0) {
  return {scene::ReplaceVertices{mesh_id, positions_of(version), {}}};
}

using Answer = std::vector<SurfaceHit>;
Answer ask(const scene::Scene& scene) {
  test::Random random(3);
  Answer answer;
  for (int i = 0; i < 20; ++i) {
    Ray ray{5.0 * random.direction(), {}};
    ray.direction = random.in_box(0.7) - ray.origin;
    answer.push_back(scene::intersect(scene, ray));
  }
  return answer;
}
bool same(const Answer& a, const Answer& b) {
  return std::ranges::equal(a, b, [](const SurfaceHit& x, const SurfaceHit& y) {
    return x.status == y.status && x.t == y.t && x.u == y.u && x.v == y.v && x.normal == y.normal &&
           x.primitive_id == y.primitive_id;
  });
}

/// False when it takes longer than any machine needs.
template <class Condition>
bool comes_true(const Condition& condition) {
  for (int i = 0; i < 60'000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}
bool is_idle(const TreeBuilder& trees) {
  return trees.counts().waiting == 0;
}
blas::BuildQuality quality_of(const NamedScene& named, std::uint32_t mesh_id = 0) {
  return named.snapshot()->blas(mesh_id).options().quality;
}
bool update(NamedScene& named, const std::vector<scene::SceneEdit>& edits) {
  return std::holds_alternative<scene::UpdateResult>(named.update("", edits));
}

TEST(TreeBuilder, better_trees_come_into_the_same_version_of_every_scene) {
  TreeBuilder trees(1);
  SceneStore store(4, nullptr, &trees);
  const auto a = std::get<0>(store.create("a", good_scene(2), {}));
  const auto b = std::get<0>(store.create("b", good_scene(), {}));
  EXPECT_TRUE(is_idle(trees));
  ASSERT_TRUE(update(*a, edits_to(15, 0)));
  ASSERT_TRUE(update(*a, edits_to(16, 1)));
  ASSERT_TRUE(update(*b, edits_to(17)));
  const Answer before = ask(*b->snapshot());
  ASSERT_TRUE(comes_true([&] { return is_idle(trees); }));
  EXPECT_EQ(trees.counts().replaced, 3U);
  EXPECT_EQ(trees.counts().dropped, 0U);
  EXPECT_GT(trees.counts().ms, 0.0);
  EXPECT_EQ(a->snapshot()->version(), 3U);
  EXPECT_EQ(b->snapshot()->version(), 2U);
  for (const blas::BuildQuality quality : {quality_of(*a, 0), quality_of(*a, 1), quality_of(*b)})
    EXPECT_EQ(quality, blas::BuildQuality::kDefault);
  EXPECT_TRUE(same(before, ask(*b->snapshot())));
  EXPECT_TRUE(a->snapshot()->validate().ok());
  EXPECT_EQ(a->live_versions(), 1U) << "the version with the tree of before is gone";
}

TEST(TreeBuilder, a_scene_that_arrives_with_a_poor_tree_gets_a_better_one) {
  const auto poor =
      apply_update(*good_scene(), edits_to(15), {scene::RebuildPlace::kInBackground}).value().scene;
  ASSERT_EQ(poor->blas(0).options().quality, blas::BuildQuality::kFast);
  TreeBuilder trees(1);
  SceneStore store(4, nullptr, &trees);
  const auto named = std::get<0>(store.create("a", poor, {}));
  ASSERT_TRUE(comes_true([&] { return is_idle(trees); }));
  EXPECT_EQ(quality_of(*named), blas::BuildQuality::kDefault);
}

TEST(TreeBuilder, erased_scenes_get_no_trees_and_closed_builders_build_none) {
  TreeBuilder trees(1);
  SceneStore store(4, nullptr, &trees);
  const auto named = std::get<0>(store.create("a", good_scene(), {}));
  const auto poor =
      apply_update(*good_scene(), edits_to(15), {scene::RebuildPlace::kInBackground}).value().scene;
  const auto gone = std::get<0>(store.create("b", poor, {}));
  ASSERT_TRUE(comes_true([&] { return is_idle(trees); }));
  ASSERT_TRUE(update(*gone, edits_to(16)));
  ASSERT_FALSE(store.erase("b", ""));
  trees.want(gone, 0);
  ASSERT_TRUE(comes_true([&] { return is_idle(trees); }));
  EXPECT_EQ(trees.counts().failed, 0U);
  const std::uint64_t replaced = trees.counts().replaced;
  trees.want(gone, 0);
  ASSERT_TRUE(comes_true([&] { return is_idle(trees); }));
  EXPECT_EQ(trees.counts().replaced, replaced);
  trees.shut_down();
  ASSERT_TRUE(update(*named, edits_to(17)));
  EXPECT_EQ(quality_of(*named), blas::BuildQuality::kFast);
  EXPECT_EQ(trees.counts().waiting, 1U);
}

TEST(TreeBuilder, a_builder_that_goes_leaves_its_build) {
  const auto mesh = test::share(test::icosphere(6));
  scene::SceneData data;
  data.meshes = {mesh};
  data.deformations.resize(1);
  auto trees = std::make_unique<TreeBuilder>(1);
  SceneStore store(1, nullptr, trees.get());
  const auto named = std::get<0>(store.create("a", build_scene(std::move(data)).value(), {}));
  ASSERT_TRUE(update(*named, {scene::ReplaceVertices{0, scattered(mesh->positions, 5), {}}}));
  ASSERT_EQ(trees->counts().waiting, 1U);
  std::this_thread::sleep_for(std::chrono::milliseconds(3));  // it has begun, and takes several times that
  trees.reset();
  EXPECT_EQ(quality_of(*named), blas::BuildQuality::kFast) << "it was not waited for";
}

/// Readers check every answer against a scene that is built anew for its version, while vertices move as fast
/// as they can and trees are replaced between.
TEST(TreeBuilder, every_answer_is_that_of_its_version_while_trees_are_replaced) {
  constexpr std::uint64_t kUpdates = 100;
  TreeBuilder trees(4);
  SceneStore store(1, nullptr, &trees);
  const auto named = std::get<0>(store.create("a", good_scene(), {}));
  std::atomic<bool> done{false};
  std::atomic<int> unlike{0};
  std::atomic<std::uint64_t> questions{0};
  std::mutex mutex;
  std::map<std::uint64_t, Answer> answers;
  const auto read = [&] {
    while (!done) {
      const auto scene = named->snapshot();
      const Answer answer = ask(*scene);
      ++questions;
      const std::lock_guard lock(mutex);
      // With whatever tree: whoever asks a version again is told the same.
      const auto [first, is_new] = answers.emplace(scene->version(), answer);
      if (!is_new && !same(first->second, answer)) ++unlike;
    }
  };
  std::vector<std::thread> readers;
  for (int i = 0; i < 2; ++i) readers.emplace_back(read);
  for (std::uint64_t version = 2; version <= kUpdates; ++version) {
    EXPECT_TRUE(update(*named, edits_to(version)));
    // Now and then the mesh comes to rest, in a mess or in a twist, until its tree is there.
    if (version % 20 == 18 || version % 20 == 9) {
      EXPECT_TRUE(comes_true([&] { return is_idle(trees); }));
    }
  }
  EXPECT_TRUE(comes_true([&] { return is_idle(trees); }));
  done = true;
  for (std::thread& reader : readers) reader.join();
  int mixed = 0;
  for (const auto& [version, answer] : answers)
    mixed += same(answer, ask(*scene_of(version == 1 ? 0 : version))) ? 0 : 1;
  EXPECT_EQ(mixed, 0) << "of " << answers.size() << " versions";
  EXPECT_EQ(unlike, 0) << "of " << questions << " questions";
  EXPECT_GT(answers.size(), 10U) << "the readers met many versions";
  EXPECT_GE(trees.counts().replaced, 5U);
  EXPECT_EQ(named->snapshot()->version(), kUpdates);
  EXPECT_EQ(named->live_versions(), 1U);
  std::printf("[          ] %llu questions of %zu versions, %llu trees replaced, %llu dropped\n",
              static_cast<unsigned long long>(questions.load()), answers.size(),
              static_cast<unsigned long long>(trees.counts().replaced),
              static_cast<unsigned long long>(trees.counts().dropped));
}

}  // namespace
}  // namespace gridcast::server
