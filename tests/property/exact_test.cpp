// Exact mode against the exact reference: closest and any hit, in every structure. More of it:
//   GRIDCAST_RAYS=1000 build/release/bin/property --gtest_filter='Exact.*'      rays per scene

#include <bit>
#include <cmath>
#include <iostream>

#include <gtest/gtest.h>

#include "core/scene/hit_error.h"
#include "core/scene/run_tracer.h"
#include "core/scene/trace.h"
#include "tests/property/exact_cases.h"
#include "tests/property/meshes.h"
#include "tests/support/exact_reference.h"

namespace gridcast::property {
namespace {

using ScenePtr = std::shared_ptr<const scene::Scene>;

std::vector<std::pair<std::string, ScenePtr>> in_every_structure(const scene::SceneData& data) {
  std::vector<StructureCase> structures = tree_cases();
  structures.push_back({"brute_force", {blas::StructureKind::kBruteForce}});
  std::vector<std::pair<std::string, ScenePtr>> scenes;
  for (const StructureCase& structure : structures)
    scenes.emplace_back(structure.name, scene::build_scene(data, {structure.options, {}, {}}).value());
  return scenes;
}

/// Whether the transforms are such that the engine hits all instances.
bool all_active(const scene::SceneData& data) {
  return std::all_of(data.instances.begin(), data.instances.end(), [](const auto& instance) {
    return InstanceTransform(instance.world_from_object).active();
  });
}

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

/// t within two ulp of the true one, which is what closest_hit_exact promises (2^-52) at the ends of binades.
void expect_accurate(const measure::exact::Ratio& truth, double t) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_GE(compare(truth, std::nextafter(std::nextafter(t, -infinity), -infinity)), 0);
  EXPECT_LE(compare(truth, std::nextafter(std::nextafter(t, infinity), infinity)), 0);
}

struct Counts {
  std::size_t rays = 0, hits = 0, ties = 0;
};

void compare_ray(const std::vector<std::pair<std::string, ScenePtr>>& scenes,
                 const test::ExactScene& reference, const Ray& ray, Counts& counts) {
  const auto expected = reference->closest(ray);
  ++counts.rays;
  counts.hits += expected ? 1 : 0;
  SurfaceHit first;
  for (const auto& [name, scene] : scenes) {
    SCOPED_TRACE(name);
    const SurfaceHit hit = scene::intersect(*scene, ray, Precision::kExact);
    ASSERT_EQ(scene::occluded(*scene, ray, Precision::kExact), expected ? RayStatus::kHit : RayStatus::kMiss);
    ASSERT_EQ(hit.status, expected ? RayStatus::kHit : RayStatus::kMiss);
    if (!expected) continue;
    ASSERT_EQ((PrimitiveRef{hit.instance_id, hit.primitive_id}), expected->primitive);
    expect_accurate(expected->at.t, hit.t);
    ASSERT_NEAR(hit.u, expected->at.u, 1e-3);
    ASSERT_NEAR(hit.v, expected->at.v, 1e-3);
    // The true t is within the certified bound.
    const double bound = scene::t_error(*scene, ray, hit);
    if (std::isfinite(bound)) {
      EXPECT_GE(compare(expected->at.t, std::nextafter(hit.t - bound, -1e300)), 0);
      EXPECT_LE(compare(expected->at.t, std::nextafter(hit.t + bound, 1e300)), 0);
    }
    if (name == scenes.front().first) first = hit;
    ASSERT_TRUE(same_bits(hit.t, first.t) && same_bits(hit.u, first.u) && same_bits(hit.v, first.v));
    // What is excluded is not hit; what is next is.
    const auto next = reference->closest(ray, expected->primitive);
    const SurfaceHit second = scene::intersect(*scene, ray, Precision::kExact, expected->primitive);
    ASSERT_EQ((PrimitiveRef{second.instance_id, second.primitive_id}),
              next ? next->primitive : PrimitiveRef{});
    if (next && name == scenes.front().first && compare(next->at.t, expected->at.t) == 0) ++counts.ties;
  }
}

TEST(Exact, AnswersAsTheReferenceOnRandomScenes) {
  Random random(test::seed_or(5101));
  Counts counts;
  for (int i = 0; i < 400; ++i) {
    const scene::SceneData data = exact_scene(random);
    if (!all_active(data)) continue;
    const auto scenes = in_every_structure(data);
    const test::ExactScene reference(data);
    for (std::size_t k = 0; k < ray_count(20); ++k) {
      const Ray ray = exact_ray(random, data);
      if (!is_valid(ray)) continue;
      ASSERT_NO_FATAL_FAILURE(compare_ray(scenes, reference, ray, counts))
          << "scene " << i << ", ray " << k << " " << std::hexfloat << ray.origin.x << " " << ray.origin.y
          << " " << ray.origin.z << " " << ray.direction.x << " " << ray.direction.y << " "
          << ray.direction.z;
    }
  }
  std::cout << counts.rays << " rays, " << counts.hits << " hits, " << counts.ties << " ties\n";
  EXPECT_GT(counts.hits, counts.rays / 3);
  EXPECT_GT(counts.ties, counts.rays / 50);
}

TEST(Exact, AnswersAsTheReferenceOnHostileTriangles) {
  Random random(test::seed_or(5102));
  Counts counts;
  for (int i = 0; i < 1500; ++i) {
    const test::HostileTriangle triangle = test::hostile_triangle(random);
    mesh::TriangleMesh mesh;
    mesh.positions.assign(triangle.corners.begin(), triangle.corners.end());
    mesh.triangles = {{0, 1, 2}, {2, 1, 0}};
    const test::ExactScene reference(test::share(mesh), triangle.transform.world_from_object());
    const auto scenes = in_every_structure(reference.data());
    for (std::size_t k = 0; k < ray_count(10); ++k) {
      const Ray ray = test::hostile_ray(triangle, random);
      ASSERT_NO_FATAL_FAILURE(compare_ray(scenes, reference, ray, counts))
          << "triangle " << i << ", ray " << k;
    }
  }
  std::cout << counts.rays << " rays, " << counts.hits << " hits\n";
  EXPECT_GT(counts.hits, counts.rays / 3);
}

/// Batches go over all cores, runs over one: the same bits as ray by ray.
TEST(Exact, BatchesAnswerAsSingleRays) {
  Random random(test::seed_or(5103));
  scene::SceneData data;
  data.meshes.push_back(test::share(test::jittered_icosphere(3, 7)));
  data.deformations.resize(1);
  for (int i = 0; i < 20; ++i)
    data.instances.push_back({{}, {Mat3d(0.7) + Mat3d(random.uniform()), random.in_box(3.0)}, 0});
  const test::ExactScene reference(data);
  std::vector<Ray> rays;
  // From farther off every triangle is decided in integers: right, but slow.
  while (rays.size() < 2500)
    if (const Ray ray = exact_ray(random, data); max_abs(ray.origin) < 1e6) rays.push_back(ray);
  std::vector<std::array<double, 8>> rows;
  for (const Ray& ray : rays)
    rows.push_back({ray.origin.x, ray.origin.y, ray.origin.z, ray.tnear, ray.direction.x, ray.direction.y,
                    ray.direction.z, ray.tfar});
  const RayBatch batch{std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, {}};
  scene::TraceOptions options;
  options.precision = Precision::kExact;
  for (const auto& [name, scene] : in_every_structure(data)) {
    SCOPED_TRACE(name);
    const HitColumns hits = scene::intersect(*scene, batch, options).value();
    const std::vector<RayStatus> any = scene::occluded(*scene, batch, options).value();
    std::vector<SurfaceHit> run(rays.size());
    scene::RunTracer(*scene, Precision::kExact).intersect(rays, {}, run);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const SurfaceHit one = scene::intersect(*scene, rays[i], Precision::kExact);
      const auto expected = reference->closest(rays[i]);
      ASSERT_EQ(one.status == RayStatus::kHit, expected.has_value());
      ASSERT_EQ(any[i], one.status);
      ASSERT_EQ(hits.status[i], one.status);
      ASSERT_EQ(hits.primitive_id[i], one.primitive_id);
      ASSERT_EQ(hits.instance_id[i], one.instance_id);
      ASSERT_TRUE(same_bits(hits.t[i], one.t));
      ASSERT_TRUE(same_bits(run[i].t, one.t) && run[i].primitive_id == one.primitive_id);
      const PrimitiveRef none;
      ASSERT_EQ((PrimitiveRef{one.instance_id, one.primitive_id}), expected ? expected->primitive : none);
    }
  }
}

}  // namespace
}  // namespace gridcast::property
