// Eight normals at once have the bits of eight normals one by one, on every instruction set.

#include "core/scene/geometric_normal.h"

#include "core/scene/trace.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

/// Slivers and a triangle whose area is lost to rounding among the others.
std::shared_ptr<const Scene> scene_of_slivers(test::Random& random) {
  SceneData data = meshes_only();
  auto slivers = std::make_shared<mesh::TriangleMesh>();
  for (int i = 0; i < 40; ++i) {
    const Vec3f corner(random.in_box(1.0)), side(random.in_box(1.0));
    const float thin = i % 8 == 0 ? 0.F : 1e-6F * float(i);
    slivers->positions.insert(slivers->positions.end(),
                              {corner, corner + side, corner + 0.5F * side + thin * Vec3f(1.F)});
    const auto first = std::uint32_t(3 * i);
    slivers->triangles.push_back({first, first + 1, first + 2});
  }
  data.meshes.push_back(slivers);
  const auto count = std::uint32_t(data.meshes.size());
  for (std::uint32_t i = 0; i < 24; ++i) place(data, i % count, random_affine(random, 4.0, 0.5));
  return built(std::move(data));
}

TEST(GeometricNormal, eight_at_once_are_those_one_by_one) {
  test::Random random(test::seed_or(72));
  const auto scene = scene_of_slivers(random);
  NormalBatch batch(*scene);
  for (int round = 0; round < 200; ++round) {
    std::array<Hit, NormalBatch::kSize> hits;
    std::array<Ray, NormalBatch::kSize> rays;
    for (std::size_t lane = 0; lane < NormalBatch::kSize; ++lane) {
      const std::uint32_t instance = random.below(24);
      const auto& mesh = scene->blas(scene->instance(instance).mesh_id).mesh();
      hits[lane] = {1.0, 0.2, 0.3, instance, random.below(std::uint32_t(mesh.triangles.size()))};
      rays[lane] = {random.in_box(3.0), random.direction()};
      batch.set(lane, hits[lane], rays[lane]);
    }
    batch.make();
    for (std::size_t lane = 0; lane < NormalBatch::kSize; ++lane) {
      const Vec3d one = geometric_normal(*scene, hits[lane], rays[lane]);
      const Vec3d many = batch.normal(lane);
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_EQ(many[axis], one[axis]) << "round " << round << ", lane " << lane;
    }
    if (::testing::Test::HasFailure()) return;
  }
}

TEST(GeometricNormal, corners_from_the_tree_are_those_of_the_mesh) {
  test::Random random(test::seed_or(73));
  const auto scene = scene_of_slivers(random);
  std::size_t found = 0;
  for (int i = 0; i < 3000; ++i) {
    const Ray ray{6.0 * random.direction(), random.direction()};
    for (std::uint32_t id = 0; id < 24; ++id) {
      const Instance instance = scene->instance(id);
      const blas::Blas& blas = scene->blas(instance.mesh_id);
      mesh::ObjectRay object;
      Hit best{.t = ray.tfar};
      if (!object.prepare({instance.transform.point_to_object(ray.origin),
                           instance.transform.vector_to_object(ray.direction)},
                          blas.bounds()))
        continue;
      object.instance_id = id;
      object.excluded_primitive = kInvalidId;
      if (!blas.intersect<Precision::kRobust>(object, best)) continue;
      found += std::size_t(best.corners_at != kInvalidId);
      EXPECT_EQ(blas.corners(best), blas.mesh().corners(best.primitive_id));
    }
  }
  EXPECT_GT(found, 100U);
}

}  // namespace
}  // namespace gridcast::scene
