#include "server/store/scene_archive.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "tests/support/puppet.h"
#include "tests/support/same_scene.h"

namespace gridcast::server::store {
namespace {

class SceneArchiveTest : public testing::Test {
 protected:
  SceneArchiveTest() {
    std::string name = (std::filesystem::temp_directory_path() / "gridcast_archive_XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~SceneArchiveTest() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::unique_ptr<SceneArchive> open() const {
    return SceneArchive::open(folder_.string(), {}).value();
  }
  /// What a later process finds.
  [[nodiscard]] std::shared_ptr<const scene::Scene> reopened() const {
    const auto archive = open();
    return archive->restore(archive->scenes().value().at(0), {}).value();
  }

  std::filesystem::path folder_;
};

std::shared_ptr<const scene::Scene> edited(const scene::Scene& scene, const scene::SceneEdit& edit) {
  return apply_update(scene, {edit}).value().scene;
}

TEST_F(SceneArchiveTest, poses_outlast_the_process_as_updates) {
  const auto rest = scene::build_scene(test::puppet()).value();
  const auto waving = edited(*rest, test::waving());
  const auto stretched = edited(*waving, test::stretched());
  {
    const auto archive = open();
    const std::int64_t key = archive->create("a", {}, *rest, 1).value();
    ASSERT_TRUE(archive->append(key, *rest, waving));
    ASSERT_TRUE(archive->append(key, *waving, stretched));
  }
  test::expect_same_scene(*stretched, *reopened());
}

TEST_F(SceneArchiveTest, poses_outlast_the_process_in_snapshots_and_are_gone_on_from) {
  scene::SceneBuildOptions options;
  options.blas.quality = blas::BuildQuality::kFast;
  const auto rest = scene::build_scene(test::puppet(), options).value();
  const auto posed = edited(*edited(*rest, test::waving()), test::stretched());
  ASSERT_TRUE(open()->create("a", {}, *posed, 1));
  const auto restored = reopened();
  test::expect_same_scene(*posed, *restored);
  EXPECT_EQ(restored->blas_options().quality, blas::BuildQuality::kFast);
  scene::SetPose next;
  next.base = scene::PoseBase::kPresent;
  next.weights = {{0, {0.8}}};
  test::expect_same_scene(*edited(*posed, next), *edited(*restored, next));
}

TEST_F(SceneArchiveTest, masks_and_names_outlast_the_process_in_updates_and_snapshots) {
  const auto first = scene::build_scene(test::puppet()).value();
  const auto second = edited(*first, scene::ChangeInstance{0, {}, InstanceMask(6), "waver"});
  const auto third = edited(*second, scene::AddInstance{0, {Mat3d(0.5), Vec3d(2.0, 1.0, 0.0)}, "added", 3});
  const auto fourth = edited(*third, scene::ChangeInstance{1, {}, InstanceMask(0), "hidden"});
  {
    const auto archive = open();
    const std::int64_t key = archive->create("a", {}, *first, 1).value();
    ASSERT_TRUE(archive->append(key, *first, second));
    ASSERT_TRUE(archive->append(key, *second, third));
    ASSERT_TRUE(archive->append(key, *third, fourth));
  }
  const auto restored = reopened();
  test::expect_same_scene(*fourth, *restored);
  EXPECT_EQ(restored->instance(0).mask, 6U);
  EXPECT_EQ(restored->instance_name(1), "hidden");
  std::filesystem::remove_all(folder_);
  ASSERT_TRUE(open()->create("b", {}, *fourth, 1));
  test::expect_same_scene(*fourth, *reopened());
}

}  // namespace
}  // namespace gridcast::server::store
