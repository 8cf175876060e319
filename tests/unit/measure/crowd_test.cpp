#include "core/measure/crowd.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/measure/figure.h"
#include "core/mesh/topology.h"
#include "core/scene/rig.h"
#include "core/scene/update.h"

namespace gridcast::measure {
namespace {

TEST(Figure, IsClosedOfTheSizeAskedForAndSkinned) {
  for (const std::size_t count : {2000, 3500, 5000}) {
    SCOPED_TRACE(count);
    const Figure figure = make_figure(count, 1.0);
    EXPECT_NEAR(double(figure.mesh.triangle_count()), double(count), 0.08 * double(count));
    ASSERT_TRUE(mesh::validate(figure.mesh));
    ASSERT_TRUE(mesh::validate(figure.deformation, figure.mesh.positions.size()));
    double volume = 0.0;
    for (std::uint32_t t = 0; t < figure.mesh.triangle_count(); ++t) {
      const auto [a, b, c] = figure.mesh.corners(t);
      volume += glm::dot(Vec3d(a), glm::cross(Vec3d(b), Vec3d(c))) / 6.0;
    }
    EXPECT_GT(volume, 0.05) << "cubic metres, all of it inside";
    EXPECT_LT(volume, 0.15);
  }
}

class Crowd : public testing::Test {
 protected:
  [[nodiscard]] scene::UpdateResult at(const scene::Scene& scene, double time_s) const {
    scene::SetPose pose;
    pose.animation = scene::AnimationTime{0U, time_s, scene::AnimationWrap::kLoop};
    return scene::apply_update(scene, {pose}).value();
  }

  CrowdSize size_{3, 8};
  std::shared_ptr<const scene::Scene> scene_ = scene::build_scene(crowd_scene(size_, 3).data).value();
};

TEST_F(Crowd, FiguresStandOnTheFloorAmongThings) {
  EXPECT_EQ(scene_->instance_count(), 11U);
  EXPECT_EQ(scene_->data().skins.size(), 3U);
  std::size_t figures = 0;
  for (const scene::InstanceData& instance : scene_->data().instances) {
    if (instance.skin_id == kInvalidId) continue;
    ++figures;
    const auto id = std::uint32_t(&instance - scene_->data().instances.data());
    const Bounds3f box = scene_->blas(scene_->instance(id).mesh_id).bounds();
    EXPECT_NEAR(box.lower.y, 0.F, 0.1F);
    EXPECT_NEAR(box.upper.y, 1.8F, 0.1F);
  }
  EXPECT_EQ(figures, 3U);
}

TEST_F(Crowd, EveryFigureMovesInItsOwnWayAndTheLoopIsClosed) {
  const auto posed = at(*scene_, 0.7);
  ASSERT_EQ(posed.report.poses.size(), 1U);
  EXPECT_EQ(posed.report.poses[0].meshes.size(), 3U);
  EXPECT_EQ(posed.report.poses[0].moved_instances, 3U);
  EXPECT_EQ(posed.report.poses[0].inactive_instances, 0U);
  EXPECT_TRUE(posed.scene->validate().ok());
  const auto begin = at(*scene_, 0.0), end = at(*scene_, kCrowdLoopSeconds - 1e-9);
  for (const scene::MeshUpdateReport& mesh : posed.report.poses[0].meshes) {
    const auto& first = begin.scene->blas(mesh.mesh_id).mesh().positions;
    const auto& last = end.scene->blas(mesh.mesh_id).mesh().positions;
    double moved = 0.0, jump = 0.0;
    for (std::size_t i = 0; i < first.size(); ++i) {
      moved = std::max(moved,
                       double(glm::distance(posed.scene->blas(mesh.mesh_id).mesh().positions[i], first[i])));
      jump = std::max(jump, double(glm::distance(first[i], last[i])));
    }
    EXPECT_GT(moved, 0.1);
    EXPECT_LT(jump, 1e-4);
  }
}

TEST(CrowdSize, KeepsAFewOfAShare) {
  EXPECT_EQ(crowd_size(1.0).figures, 30U);
  EXPECT_EQ(crowd_size(1.0).things, 300U);
  EXPECT_EQ(crowd_size(0.5).figures, 15U);
  EXPECT_EQ(crowd_size(1e-6).figures, 2U);
}

}  // namespace
}  // namespace gridcast::measure
