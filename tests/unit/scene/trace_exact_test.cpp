// Exact mode where the answer is known by hand.

#include <gtest/gtest.h>

#include "core/scene/trace.h"
#include "tests/support/shapes.h"
#include "tests/support/squeezed.h"

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
  for (const double height : heights) data.instances.push_back({{}, {Mat3d(1.0), {0.0, height, 0.0}}, 0});
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

/// Triangles that stand on their corners (x, 0, z), x and z whole, in the plane y = 0.
mesh::TriangleMesh tips() {
  mesh::TriangleMesh mesh;
  for (int x = 0; x < 4; ++x) {
    for (int z = 0; z < 4; ++z) {
      const Vec3f tip(float(x), 0.F, float(z));
      const auto first = std::uint32_t(mesh.positions.size());
      mesh.positions.insert(mesh.positions.end(),
                            {tip, tip + Vec3f(0.25F, 1.F, 0.F), tip + Vec3f(-0.25F, 1.F, 0.125F)});
      mesh.triangles.push_back({first, first + 1, first + 2});
    }
  }
  return mesh;
}

// The image of the ray passes some 2^-20 below or above the plane, so that the boxes and the filters need the
// room that its drift asks for, alone and in packets.
TEST(TraceExact, CornersAreHitWhereTheImageOfTheRayHasFewDigits) {
  test::Random random(test::seed_or(5207));
  for (const blas::StructureKind kind : {blas::StructureKind::kBruteForce, blas::StructureKind::kWideBvh,
                                         blas::StructureKind::kCompactBvh, blas::StructureKind::kKdTree}) {
    SCOPED_TRACE(to_string(kind));
    int lost = 0;
    for (int i = 0; i < 40; ++i) {
      const test::SqueezedPlane plane(random);
      SceneData data;
      data.meshes.push_back(test::share(tips()));
      data.deformations.resize(1);
      data.instances.push_back({{}, plane.world_from_object(), 0});
      SceneBuildOptions options;
      options.blas.kind = kind;
      const auto scene = build_scene(std::move(data), options).value();
      std::vector<double> rows;
      for (int ray_id = 0; ray_id < 16; ++ray_id) {
        const Ray ray = plane.ray_to(1, ray_id / 4, double(ray_id % 4));
        lost += int(occluded(*scene, ray, Precision::kExact) != RayStatus::kHit);
        // Neighbours that go the same way are traced as a packet.
        for (int neighbour = 0; neighbour < 32; ++neighbour)
          rows.insert(rows.end(), {ray.origin.x, ray.origin.y, ray.origin.z, ray.tnear, ray.direction.x,
                                   ray.direction.y, ray.direction.z, ray.tfar});
      }
      TraceOptions trace;
      trace.precision = Precision::kExact;
      const RayBatch batch{std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, {}};
      const std::vector<RayStatus> together = occluded(*scene, batch, trace).value();
      for (const RayStatus status : together) lost += int(status != RayStatus::kHit);
    }
    EXPECT_EQ(lost, 0);
  }
}

TEST(TraceExact, InvalidRaysAreSaidToBe) {
  const auto scene = squares_at({0.0});
  EXPECT_EQ(intersect(*scene, Ray{{0, 1, 0}, Vec3d(0.0)}, Precision::kExact).status, RayStatus::kInvalid);
}

}  // namespace
}  // namespace gridcast::scene
