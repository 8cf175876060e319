// Readers that check every answer against a scene built afresh for its version, while updates arrive as fast
// as they go.

#include <atomic>
#include <cstdlib>
#include <map>
#include <mutex>
#include <thread>

#include <gtest/gtest.h>

#include "core/scene/trace.h"
#include "server/scene_store.h"
#include "tests/support/shapes.h"

namespace gridcast::server {
namespace {

constexpr std::uint64_t kUpdates = 3000;
constexpr int kReaders = 3;
// Where cores are few the writer could do all its work in one go: this often it waits to be read.
constexpr std::uint64_t kUpdatesPerWait = 100;

/// What version v holds: two boxes that grow and shrink with v, the first at x = v, the second above it.
float half_of(std::uint64_t version) {
  return 1.F + float(version % 8) / 8.F;
}
mesh::TriangleMesh box_of(std::uint64_t version) {
  const float half = half_of(version);
  return test::box({-half, -half, -half}, {half, half, half});
}
Affine place_of(std::uint64_t version, std::uint32_t instance) {
  Affine place;
  place.translation = {double(version), 10.0 * instance, 0.0};
  return place;
}

std::shared_ptr<const scene::Scene> scene_of(std::uint64_t version) {
  scene::SceneData data;
  data.meshes = {test::share(box_of(version))};
  data.deformations.resize(1);
  for (std::uint32_t id = 0; id < 2; ++id) {
    scene::InstanceData instance;
    instance.mesh_id = 0;
    instance.world_from_object = place_of(version, id);
    data.instances.push_back(instance);
  }
  return build_scene(std::move(data)).value();
}

std::vector<scene::SceneEdit> edits_to(std::uint64_t version) {
  scene::ReplaceVertices vertices;
  vertices.mesh_id = 0;
  vertices.positions = box_of(version).positions;
  return {scene::MoveInstance{0, place_of(version, 0)}, std::move(vertices),
          scene::MoveInstance{1, place_of(version, 1)}};
}

/// Rays that meet both boxes from the side and from above: three reads of each version that must agree.
using Answer = std::vector<SurfaceHit>;
Answer ask(const scene::Scene& scene, std::uint64_t version) {
  const double x = double(version);
  Answer answer;
  for (const Ray& ray :
       {Ray{{-50.0, 0.25, 0.125}, {1.0, 0.0, 0.0}}, Ray{{1e4, 10.25, 0.125}, {-1.0, 0.0, 0.0}},
        Ray{{x + 0.5, 100.0, 0.25}, {0.0, -1.0, 0.0}}})
    answer.push_back(scene::intersect(scene, ray));
  return answer;
}

bool same(const Answer& a, const Answer& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].status != b[i].status || a[i].t != b[i].t || a[i].instance_id != b[i].instance_id ||
        a[i].primitive_id != b[i].primitive_id || a[i].u != b[i].u || a[i].v != b[i].v ||
        a[i].normal != b[i].normal)
      return false;
  }
  return a.size() == b.size();
}

TEST(Isolation, every_answer_is_that_of_one_version) {
  SceneStore store(1);
  const auto named = std::get<0>(store.create("a", scene_of(1), {}));
  std::atomic<bool> done{false};
  std::mutex mutex;
  std::map<std::uint64_t, Answer> answers;
  std::atomic<std::uint64_t> questions{0};
  std::atomic<int> unlike{0};
  std::atomic<std::uint64_t> last_read{0};
  const auto read = [&] {
    while (!done) {
      const auto scene = named->snapshot();
      Answer answer = ask(*scene, scene->version());
      ++questions;
      last_read = scene->version();
      const std::lock_guard lock(mutex);
      // Whoever asks the same version later must be told the same.
      const auto [first, is_new] = answers.emplace(scene->version(), std::move(answer));
      if (!is_new && !same(first->second, ask(*scene, scene->version()))) ++unlike;
    }
  };
  std::vector<std::thread> readers;
  for (int i = 0; i < kReaders; ++i) readers.emplace_back(read);
  for (std::uint64_t version = 2; version <= kUpdates; ++version) {
    ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(named->update("", edits_to(version))));
    // A refused update between them changes nothing: its first edits were fine.
    auto refused = edits_to(version + 77);
    refused.emplace_back(scene::RemoveInstance{99});
    ASSERT_TRUE(std::holds_alternative<Error>(named->update("", refused)));
    while (version % kUpdatesPerWait == 0 && last_read < version) std::this_thread::yield();
  }
  done = true;
  for (std::thread& reader : readers) reader.join();
  int mixed = 0;
  for (const auto& [version, answer] : answers)
    mixed += same(answer, ask(*scene_of(version), version)) ? 0 : 1;
  EXPECT_EQ(mixed, 0) << "of " << answers.size() << " versions";
  EXPECT_EQ(unlike, 0) << "of " << questions << " questions";
  EXPECT_GT(answers.size(), 20U) << "the readers met many versions";
  EXPECT_EQ(named->snapshot()->version(), kUpdates);
  std::printf("[          ] %llu questions of %zu versions, %llu updates\n",
              static_cast<unsigned long long>(questions.load()), answers.size(),
              static_cast<unsigned long long>(kUpdates));
}

TEST(Isolation, a_mixed_answer_would_be_noticed) {
  auto edits = edits_to(5);
  edits.pop_back();  // the second box stays behind
  const auto torn = apply_update(*scene_of(1), edits).value().scene;
  EXPECT_FALSE(same(ask(*torn, 5), ask(*scene_of(5), 5)));
  edits = edits_to(5);
  edits.erase(edits.begin() + 1);  // the boxes keep their size
  EXPECT_FALSE(same(ask(*apply_update(*scene_of(1), edits).value().scene, 5), ask(*scene_of(5), 5)));
}

TEST(Isolation, an_old_version_goes_with_its_last_reader) {
  SceneStore store(2);
  const auto named = std::get<0>(store.create("a", scene_of(1), {}));
  std::weak_ptr<const scene::Scene> first = named->snapshot();
  auto reader = named->snapshot();
  for (std::uint64_t version = 2; version <= 50; ++version)
    ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(named->update("", edits_to(version))));
  EXPECT_FALSE(first.expired());
  EXPECT_EQ(named->live_versions(), 2U) << "the newest and the one that is read";
  reader.reset();
  EXPECT_TRUE(first.expired());
  EXPECT_EQ(named->live_versions(), 1U);
}

TEST(Isolation, a_fork_goes_its_own_way_and_shares_what_neither_changes) {
  SceneStore store(2);
  const auto original = std::get<0>(store.create("a", scene_of(1), {}));
  ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(original->update("", edits_to(2))));
  const auto fork = std::get<0>(store.create("b", original->snapshot(), original->origin()));
  EXPECT_EQ(fork->snapshot(), original->snapshot());
  ASSERT_TRUE(std::holds_alternative<scene::UpdateResult>(fork->update("\"2\"", edits_to(3))));
  EXPECT_TRUE(same(ask(*original->snapshot(), 2), ask(*scene_of(2), 2)));
  EXPECT_TRUE(same(ask(*fork->snapshot(), 3), ask(*scene_of(3), 3)));
  EXPECT_FALSE(store.erase("a", ""));
  EXPECT_TRUE(same(ask(*fork->snapshot(), 3), ask(*scene_of(3), 3)));
}

}  // namespace
}  // namespace gridcast::server
