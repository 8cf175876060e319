#include "core/measure/scenes.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "core/mesh/triangle_mesh.h"

namespace gridcast::measure {
namespace {

constexpr double kSmall = 0.01;

TEST(Scenes, EveryNameOfTheCatalogueMakesAValidScene) {
  for (const SceneEntry& entry : scene_catalogue()) {
    SCOPED_TRACE(std::string(entry.name));
    const auto scene = make_scene(entry.name, 3, kSmall);
    ASSERT_TRUE(scene);
    EXPECT_EQ(scene->name, entry.name);
    ASSERT_FALSE(scene->data.instances.empty());
    for (const auto& mesh : scene->data.meshes) {
      EXPECT_TRUE(mesh::validate(*mesh));
      EXPECT_GT(mesh->triangle_count(), 40U);
    }
  }
}

TEST(Scenes, TheSameSeedMakesTheSameSceneAndAnotherSeedAnother) {
  for (const char* name : {"S1", "S2", "S3", "S4", "S5", "S6", "I1"}) {
    SCOPED_TRACE(name);
    const auto one = make_scene(name, 3, kSmall), same = make_scene(name, 3, kSmall);
    const auto other = make_scene(name, 4, kSmall);
    EXPECT_EQ(one->data.meshes[0]->positions, same->data.meshes[0]->positions);
    EXPECT_EQ(one->data.meshes[0]->triangles, same->data.meshes[0]->triangles);
    EXPECT_NE(one->data.meshes[0]->positions, other->data.meshes[0]->positions);
  }
}

TEST(Scenes, SizesAreThoseOfTheDescriptionWithinThreePercent) {
  const auto triangles = [](const char* name) {
    return double(make_scene(name, 1)->data.meshes[0]->triangle_count());
  };
  EXPECT_NEAR(triangles("S1"), 69e3, 0.03 * 69e3);
  EXPECT_NEAR(triangles("S2"), 268e3, 0.03 * 268e3);
  EXPECT_NEAR(triangles("S4"), 324e3, 0.03 * 324e3);
  EXPECT_NEAR(triangles("S6"), 500e3, 0.03 * 500e3);
  EXPECT_EQ(make_scene("I3", 1)->data.instances.size(), 10'000U);
}

TEST(Scenes, TheStadiumCrowdsNinetyNineOfAHundredIntoAThousandthOfTheVolume) {
  const auto scene = make_scene("I3", 1);
  std::size_t crowded = 0;
  Bounds3d all;
  for (const auto& instance : scene->data.instances) all.extend(instance.world_from_object.translation);
  const Vec3d middle(200.0), half(20.0);
  EXPECT_GT(std::min({all.extent().x, all.extent().y, all.extent().z}), 380.0);
  for (const auto& instance : scene->data.instances) {
    const Vec3d from_middle = glm::abs(instance.world_from_object.translation - middle);
    crowded += glm::all(glm::lessThanEqual(from_middle, half)) ? 1 : 0;
  }
  EXPECT_NEAR(double(crowded), 9900.0, 100.0);
}

TEST(Scenes, AnUnknownNameIsAnError) {
  const auto scene = make_scene("S9", 1);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace gridcast::measure
