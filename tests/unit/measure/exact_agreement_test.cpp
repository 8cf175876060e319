// The reference against another implementation of exact arithmetic, and its filter against none.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "core/measure/exact/reference.h"
#include "tests/support/random.h"
#include "tests/support/rational_oracle.h"
#include "tests/support/shapes.h"

namespace gridcast::measure::exact {
namespace {

using test::Random;

/// A few triangles, a few instances and what aims a ray at them.
struct Case {
  std::vector<mesh::TriangleMesh> meshes;
  std::vector<Instance> instances;

  [[nodiscard]] std::vector<Mesh> views() const {
    std::vector<Mesh> views;
    for (const auto& mesh : meshes) views.push_back({mesh.positions, mesh.triangles});
    return views;
  }
};

/// Identity, rotation-like, sheared, mirrored, far away, huge or tiny.
Affine random_affine(Random& random) {
  Affine affine;
  const std::uint32_t kind = random.below(6);
  if (kind > 0)
    for (int c = 0; c < 3; ++c) affine.linear[c] += random.in_box(0.7);
  if (kind == 2) affine.linear[0] = -affine.linear[0];
  if (kind == 3) affine.translation = random.in_box(1e6);
  if (kind == 4) affine.linear *= 1e-12;
  if (kind == 5) affine.linear *= 1e12;
  return affine;
}

Case random_case(Random& random) {
  Case made;
  const std::uint64_t seed = random.bits();
  switch (random.below(6)) {
    case 0:
      made.meshes.push_back(test::soup(12, seed, 1.5F));
      break;
    case 1:
      made.meshes.push_back(test::slivers(12, seed, 1e6F));
      break;
    case 2:
      made.meshes.push_back(test::box({-1, -1, -1}, {1, 2, 1}));
      break;
    case 3:
      made.meshes.push_back(test::needle_fan(12));
      break;
    case 4:
      made.meshes.push_back(test::translated(test::soup(12, seed, 1.5F), {1e4F, -3e3F, 1e5F}));
      break;
    default: {
      // Small whole numbers: ties, in-plane rays and triangles without area come up by themselves.
      mesh::TriangleMesh mesh;
      for (int i = 0; i < 15; ++i)
        mesh.positions.emplace_back(float(random.below(4)), float(random.below(4)), float(random.below(3)));
      for (int i = 0; i < 14; ++i)
        mesh.triangles.push_back({random.below(15), random.below(15), random.below(15)});
      made.meshes.push_back(mesh);
    }
  }
  const std::uint32_t count = 1 + random.below(2);
  for (std::uint32_t i = 0; i < count; ++i) made.instances.push_back({i, 0, random_affine(random)});
  if (random.below(4) == 0) made.instances.push_back({count, 0, made.instances[0].world_from_object});
  return made;
}

/// At a corner, an edge or the inside of some triangle, along an axis, or anywhere.
Ray random_ray(Random& random, const Case& scene) {
  const Instance& instance = scene.instances[random.below(std::uint32_t(scene.instances.size()))];
  const mesh::TriangleMesh& mesh = scene.meshes[0];
  const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangles.size())));
  const std::uint32_t kind = random.below(6);
  double u = random.uniform(), v = random.uniform(0.0, 1.0 - u);
  if (kind == 0) u = v = 0.0;
  if (kind == 1) u = 0.5, v = 0.0;
  const Vec3d p = (1.0 - u - v) * Vec3d(corners[0]) + u * Vec3d(corners[1]) + v * Vec3d(corners[2]);
  const Vec3d target = instance.world_from_object.point(p);
  const double size = std::max({max_abs(instance.world_from_object.vector(Vec3d(1, 2, 3))), 1e-300});
  Ray ray;
  ray.origin = target + random.in_box(3.0) * size;
  ray.direction = target - ray.origin;
  if (kind == 2) {  // axis-parallel, through the target
    const int axis = int(random.below(3));
    ray.origin = target, ray.direction = Vec3d(0.0);
    ray.origin[axis] -= 5.0 * size, ray.direction[axis] = size;
  }
  if (kind == 3) ray.direction = Vec3d(corners[1]) - Vec3d(corners[0]);  // grazing
  if (kind == 4) ray.origin = Vec3d(float(random.below(4)), float(random.below(4)), float(random.below(4)));
  if (random.below(4) == 0) ray.tnear = -1.0;
  if (random.below(4) == 0) ray.tfar = 1.0;
  return ray;
}

void expect_same(const Ray& ray, const Reference& reference, const std::vector<test::RationalHit>& expected) {
  const std::vector<Hit> all = reference.all(ray);
  ASSERT_EQ(all.size(), expected.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    ASSERT_EQ(all[i].primitive, expected[i].primitive);
    ASSERT_EQ(test::to_rational(all[i].at.t), expected[i].t);
    // mpq rounds towards zero.
    ASSERT_LE(std::abs(all[i].at.u - expected[i].u.get_d()), 0x1p-52);
    ASSERT_LE(std::abs(all[i].at.v - expected[i].v.get_d()), 0x1p-52);
    const auto one = reference.of_primitive(ray, all[i].primitive);
    ASSERT_TRUE(one);
    ASSERT_EQ(compare(one->at.t, all[i].at.t), 0);
  }
  ASSERT_EQ(reference.any(ray), !expected.empty());
  const auto closest = reference.closest(ray);
  ASSERT_EQ(closest.has_value(), !expected.empty());
  if (!closest) return;
  ASSERT_EQ(closest->primitive, expected[0].primitive);
  ASSERT_EQ(test::to_rational(closest->at.t), expected[0].t);
}

TEST(ExactAgreement, WithRationalsOnPlanes) {
  Random random(test::seed_or(4101));
  std::size_t hits = 0, ties = 0;
  for (int i = 0; i < 600; ++i) {
    const Case scene = random_case(random);
    const Reference reference = Reference::build(scene.views(), scene.instances).value();
    const test::RationalOracle oracle(scene.views(), scene.instances);
    for (int k = 0; k < 20; ++k) {
      const Ray ray = random_ray(random, scene);
      const auto expected = oracle.all(ray);
      hits += expected.empty() ? 0 : 1;
      ties += expected.size() > 1 && expected[0].t == expected[1].t ? 1 : 0;
      ASSERT_NO_FATAL_FAILURE(expect_same(ray, reference, expected)) << "scene " << i << ", ray " << k;
    }
  }
  // What is compared must not be empty.
  EXPECT_GT(hits, 5000U);
  EXPECT_GT(ties, 500U);
}

/// Every triangle decided in integers, no boxes, no filter.
std::vector<PrimitiveRef> unfiltered(const Ray& ray, const Case& scene) {
  std::vector<PrimitiveRef> hits;
  for (const Instance& instance : scene.instances)
    for (std::uint32_t i = 0; i < scene.meshes[instance.mesh].triangles.size(); ++i)
      if (intersect(ray, instance.world_from_object, scene.meshes[instance.mesh].corners(i)))
        hits.push_back({instance.instance_id, i});
  return hits;
}

TEST(ExactAgreement, TheFilterAndTheBoxesRuleOutNoHit) {
  Random random(test::seed_or(4102));
  for (int i = 0; i < 8; ++i) {
    Case scene;
    scene.meshes.push_back(i % 2 == 0 ? test::jittered_icosphere(2, random.bits())
                                      : test::slivers(300, random.bits(), 1e7F));
    scene.instances.push_back({0, 0, random_affine(random)});
    scene.instances.push_back({1, 0, random_affine(random)});
    const Reference reference = Reference::build(scene.views(), scene.instances).value();
    for (int k = 0; k < 100; ++k) {
      const Ray ray = random_ray(random, scene);
      std::vector<PrimitiveRef> found;
      for (const Hit& hit : reference.all(ray)) found.push_back(hit.primitive);
      const std::vector<PrimitiveRef> expected = unfiltered(ray, scene);
      ASSERT_TRUE(std::is_permutation(found.begin(), found.end(), expected.begin(), expected.end()))
          << "scene " << i << ", ray " << k << ": " << found.size() << " of " << expected.size();
    }
  }
}

TEST(ExactAgreement, TheFilterIsRightWhereItIsSure) {
  Random random(test::seed_or(4103));
  std::size_t sure = 0, total = 0;
  for (int i = 0; i < 400; ++i) {
    const Case scene = random_case(random);
    double extent = 0.0;
    for (const Vec3f& p : scene.meshes[0].positions) extent = std::max(extent, double(max_abs(p)));
    for (int k = 0; k < 10; ++k) {
      Ray ray = random_ray(random, scene);
      ray.tnear = -std::numeric_limits<double>::infinity(), ray.tfar = -ray.tnear;
      const WideRay wide(ray);
      const Instance& instance = scene.instances[0];
      const InstanceFrame frame(instance.world_from_object, extent, wide);
      for (std::uint32_t p = 0; p < scene.meshes[0].triangles.size(); ++p) {
        const auto corners = scene.meshes[0].corners(p);
        const FilterAnswer answer = frame.test(wide, corners);
        const auto hit = intersect(ray, instance.world_from_object, corners);
        ++total;
        if (answer.verdict == Verdict::kMiss) {
          ASSERT_FALSE(hit);
        }
        if (answer.verdict == Verdict::kHit) {
          ASSERT_TRUE(hit);
        }
        if (answer.verdict != Verdict::kUnsure) ++sure;
        if (!hit) continue;
        // Bounds as doubles, outward.
        const auto low = std::nextafter(double(answer.low), -std::numeric_limits<double>::infinity());
        const auto high = std::nextafter(double(answer.high), std::numeric_limits<double>::infinity());
        ASSERT_GE(compare(hit->t, low), 0);
        ASSERT_LE(compare(hit->t, high), 0);
      }
    }
  }
  EXPECT_GT(double(sure), 0.7 * double(total));
}

#if defined(__x86_64__)
TEST(ExactAgreement, DenormalsAreNumbersEvenWhereTheCallerFlushesThem) {
  const float tiny = std::numeric_limits<float>::denorm_min();
  const mesh::TriangleMesh mesh{"", {{0, 0, 0}, {4 * tiny, 0, 0}, {0, 4 * tiny, 0}}, {{0, 1, 2}}, {}, {}};
  const unsigned before = __builtin_ia32_stmxcsr();
  __builtin_ia32_ldmxcsr(before | 0x8040U);  // flush to zero, denormals are zero
  const Reference reference = Reference::build({{mesh.positions, mesh.triangles}}, {{0, 0, {}}}).value();
  const double s = 0x1p-149;
  const Ray ray{{s, s, 3 * s}, {0, 0, -0x1p-1074}};
  const bool hit = reference.any(ray);
  const unsigned after = __builtin_ia32_stmxcsr();
  __builtin_ia32_ldmxcsr(before);
  EXPECT_TRUE(hit);
  EXPECT_EQ(after & 0x8040U, 0x8040U) << "the caller's setting comes back";
}
#endif

}  // namespace
}  // namespace gridcast::measure::exact
