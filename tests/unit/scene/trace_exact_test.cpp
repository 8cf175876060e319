// Exact mode where the answer is known by hand.

#include <gtest/gtest.h>

#include "core/scene/trace.h"
#include "tests/support/shapes.h"

namespace gridcast::scene {
namespace {

/// A square at y = 0 of two triangles, in as many places as there are heights.
std::shared_ptr<const Scene> squares_at(const std::vector<double>& heights) {
  mesh::TriangleMesh square;
  square.positions = {{-1, 0, -1}, {1, 0, -1}, {1, 0, 1}, {-1, 0, 1}};
  square.triangles = {{0, 2, 1}, {0, 3, 2}};
  SceneData data;
  data.meshes.push_back(test::share(square));
  data.deformations.resize(1);
  for (const double height : heights) data.instances.push_back({{}, 0, {Mat3d(1.0), {0.0, height, 0.0}}});
  return build_scene(data).value();
}

constexpr Vec3d kDown{0.0, -1.0, 0.0};

TEST(TraceExact, SeesWhichOfTwoPlanesIsCloserWhereDoublesCannot) {
  const auto scene = squares_at({-0x1p-60, 0.0, -0x1p-61});
  const Ray ray{{0.5, 1.0, 0.25}, kDown};
  EXPECT_EQ(intersect(*scene, ray, Precision::kRobust).instance_id, 0U) << "rounded, all are at 1";
  EXPECT_EQ(intersect(*scene, ray, Precision::kExact).instance_id, 1U);
  const SurfaceHit second = intersect(*scene, ray, Precision::kExact, {1, 0});
  EXPECT_EQ(second.instance_id, 2U);
}

TEST(TraceExact, TiesGoToTheSmallerIds) {
  const auto scene = squares_at({0.0, 0.0});
  const SurfaceHit hit = intersect(*scene, Ray{{0.0, 1.0, 0.0}, kDown}, Precision::kExact);
  EXPECT_EQ(hit.instance_id, 0U);
  EXPECT_EQ(hit.primitive_id, 0U) << "the diagonal belongs to both triangles";
  EXPECT_EQ(intersect(*scene, Ray{{0.0, 1.0, 0.0}, kDown}, Precision::kExact, {0, 0}).primitive_id, 1U);
}

TEST(TraceExact, TheRangeIsClosedAndNotRounded) {
  const auto scene = squares_at({-0x1p-60});
  const Ray ends_before{{0.5, 1.0, 0.25}, kDown, 0.0, 1.0};
  EXPECT_EQ(intersect(*scene, ends_before, Precision::kRobust).status, RayStatus::kHit);
  EXPECT_EQ(intersect(*scene, ends_before, Precision::kExact).status, RayStatus::kMiss);
  EXPECT_EQ(occluded(*scene, ends_before, Precision::kExact), RayStatus::kMiss);
  const Ray begins_before{{0.5, 1.0, 0.25}, kDown, 1.0};
  EXPECT_EQ(intersect(*scene, begins_before, Precision::kExact).status, RayStatus::kHit);
  const auto at_zero = squares_at({0.0});
  EXPECT_EQ(occluded(*at_zero, Ray{{0.5, 1.0, 0.25}, kDown, 1.0, 1.0}, Precision::kExact), RayStatus::kHit);
}

TEST(TraceExact, TheBorderIsHitAndBesideItIsNot) {
  const auto scene = squares_at({0x1p-70});
  EXPECT_EQ(occluded(*scene, Ray{{1.0, 1.0, 0.25}, kDown}, Precision::kExact), RayStatus::kHit);
  EXPECT_EQ(occluded(*scene, Ray{{1.0, 1.0, 0.25}, {0x1p-80, -1.0, 0.0}}, Precision::kExact),
            RayStatus::kMiss);
  EXPECT_EQ(occluded(*scene, Ray{{1.0, 1.0, 0.25}, {-0x1p-80, -1.0, 0.0}}, Precision::kExact),
            RayStatus::kHit);
}

TEST(TraceExact, ARayInThePlaneHitsNothing) {
  const auto scene = squares_at({0.25});
  EXPECT_EQ(occluded(*scene, Ray{{-3.0, 0.25, 0.25}, {1.0, 0.0, 0.0}}, Precision::kExact), RayStatus::kMiss);
  EXPECT_EQ(occluded(*scene, Ray{{-3.0, 0.25, 0.25}, {1.0, 0x1p-90, 0.0}}, Precision::kExact),
            RayStatus::kMiss);
  EXPECT_EQ(occluded(*scene, Ray{{0.0, 0.25, 0.25}, {1.0, 0x1p-90, 0.0}}, Precision::kExact),
            RayStatus::kHit);
}

TEST(TraceExact, InvalidRaysAreSaidToBe) {
  const auto scene = squares_at({0.0});
  EXPECT_EQ(intersect(*scene, Ray{{0, 1, 0}, Vec3d(0.0)}, Precision::kExact).status, RayStatus::kInvalid);
}

}  // namespace
}  // namespace gridcast::scene
