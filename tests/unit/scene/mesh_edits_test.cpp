// Meshes of one update are refitted and rebuilt side by side: nothing may depend on which thread takes which.

#include <optional>

#include <oneapi/tbb/task_arena.h>

#include "core/scene/update.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

constexpr std::uint32_t kMeshes = 12;

std::shared_ptr<const Scene> scene_of_spheres(blas::StructureKind kind) {
  SceneData data;
  for (std::uint32_t id = 0; id < kMeshes; ++id) {
    data.meshes.push_back(test::share(test::jittered_icosphere(3, id)));
    place(data, id, {Mat3d(1.0), Vec3d(3.0 * id, 0.0, 0.0)});
  }
  data.deformations.resize(kMeshes);
  SceneBuildOptions options;
  options.blas.kind = kind;
  return built(std::move(data), options);
}

/// Every mesh moves, the last first; every third so far that its tree is built anew.
std::vector<SceneEdit> edits_of_all(const Scene& scene, UpdateMode mode) {
  test::Random random(151);
  std::vector<SceneEdit> edits;
  for (std::uint32_t id = kMeshes; id-- > 0;) {
    std::vector<Vec3f> positions = scene.blas(id).mesh().positions;
    for (Vec3f& p : positions) p += Vec3f(random.in_box(id % 3 == 0 ? 1.0 : 0.001));
    edits.emplace_back(ReplaceVertices{id, std::move(positions), {}, mode});
  }
  return edits;
}

TEST(MeshEdits, many_meshes_at_once_come_out_as_each_alone_on_any_number_of_threads) {
  const auto scene = scene_of_spheres(blas::StructureKind::kWideBvh);
  const std::vector<SceneEdit> edits = edits_of_all(*scene, UpdateMode::kAuto);
  auto alone = scene;
  for (const SceneEdit& edit : edits) alone = apply_update(*alone, {edit}).value().scene;
  for (const int threads : {1, 4}) {
    SCOPED_TRACE(threads);
    std::optional<UpdateResult> together;
    oneapi::tbb::task_arena(threads).execute([&] { together = apply_update(*scene, edits).value(); });
    EXPECT_TRUE(together->scene->validate().ok());
    for (std::uint32_t i = 0; i < kMeshes; ++i) {
      const MeshUpdateReport& report = together->report.meshes[i];
      const std::uint32_t id = kMeshes - 1 - i;
      ASSERT_EQ(report.mesh_id, id) << "in the order of the edits";
      EXPECT_EQ(report.action, id % 3 == 0 ? MeshAction::kRebuild : MeshAction::kRefit) << report.reason;
      EXPECT_EQ(report.cost_before, scene->blas(id).stats().cost);
      EXPECT_EQ(report.cost_after, alone->blas(id).stats().cost);
      EXPECT_EQ(together->scene->blas(id).mesh().positions, alone->blas(id).mesh().positions);
      EXPECT_EQ(together->scene->hull(id).magnitude(), alone->hull(id).magnitude());
    }
    test::Random random(152);
    for (int i = 0; i < 500; ++i) {
      const Ray ray = random_ray(*alone, random);
      ASSERT_TRUE(same(intersect(*together->scene, ray), intersect(*alone, ray))) << "ray " << i;
    }
  }
}

TEST(MeshEdits, of_several_meshes_that_fail_the_first_is_named) {
  const auto scene = scene_of_spheres(blas::StructureKind::kKdTree);
  const auto result = apply_update(*scene, edits_of_all(*scene, UpdateMode::kRefit));
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(result.error().where, "/edits/" + std::to_string(kMeshes - 1) + "/mode")
      << "mesh 0 is edited last";
}

}  // namespace
}  // namespace gridcast::scene
