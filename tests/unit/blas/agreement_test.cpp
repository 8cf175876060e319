// Every structure gives the bits of brute force.

#include <bit>
#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "core/blas/blas.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

constexpr int kRaysPerMesh = 1500;

/// Rays around a mesh with what brute force answers; computed once for all structures.
template <Precision kPrecision>
struct Reference {
  std::vector<RayCase> rays;
  std::vector<Hit> hits;

  Reference(const MeshCase& mesh_case, std::uint64_t seed) {
    const Blas brute_force = Blas::build(mesh_case.mesh, {StructureKind::kBruteForce}).value();
    RayMaker maker(*mesh_case.mesh, seed);
    for (int i = 0; i < kRaysPerMesh; ++i) {
      const RayCase ray = maker.any();
      const Hit hit = add(brute_force, ray);
      if (hit.valid() && i % 4 == 0) add_range_ends(brute_force, ray, hit);
    }
  }

 private:
  Hit add(const Blas& brute_force, const RayCase& ray) {
    rays.push_back(ray);
    hits.push_back(closest<kPrecision>(brute_force, ray));
    return hits.back();
  }

  /// The segment begins or ends exactly on the hit, or one double before or after it; and the hit left out.
  void add_range_ends(const Blas& brute_force, const RayCase& ray, const Hit& hit) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    for (const double t : {hit.t, std::nextafter(hit.t, kInfinity), std::nextafter(hit.t, -kInfinity)}) {
      RayCase changed = ray;
      changed.ray.tnear = t;
      add(brute_force, changed);
      changed.ray.tfar = t;
      add(brute_force, changed);
      changed.ray.tnear = ray.ray.tnear;
      add(brute_force, changed);
    }
    add(brute_force, {ray.ray, hit.primitive_id});
  }
};

template <Precision kPrecision>
const Reference<kPrecision>& reference(const MeshCase& mesh_case) {
  static std::map<std::string, Reference<kPrecision>> cache;
  const auto found = cache.find(mesh_case.name);
  if (found != cache.end()) return found->second;
  const std::uint64_t seed = test::seed_or(17);
  return cache.try_emplace(mesh_case.name, mesh_case, seed).first->second;
}

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

class Agreement : public testing::TestWithParam<StructureCase> {
 protected:
  template <Precision kPrecision>
  void compare_with_brute_force() {
    for (const MeshCase& mesh_case : mesh_cases()) {
      SCOPED_TRACE(mesh_case.name);
      const Reference<kPrecision>& expected = reference<kPrecision>(mesh_case);
      const Result<Blas> blas = Blas::build(mesh_case.mesh, GetParam().options);
      ASSERT_TRUE(blas.ok());
      std::size_t hits = 0;
      for (std::size_t i = 0; i < expected.rays.size(); ++i) {
        const Hit& want = expected.hits[i];
        const Hit got = closest<kPrecision>(*blas, expected.rays[i]);
        hits += std::size_t(want.valid());
        ASSERT_EQ(got.primitive_id, want.primitive_id) << "ray " << i;
        ASSERT_TRUE(same_bits(got.t, want.t) && same_bits(got.u, want.u) && same_bits(got.v, want.v))
            << "ray " << i << ": t " << got.t << " against " << want.t;
        ASSERT_EQ(any<kPrecision>(*blas, expected.rays[i]), want.valid()) << "ray " << i;
      }
      EXPECT_GT(hits, expected.rays.size() / 20) << "too few hits to mean anything";
    }
  }
};

TEST_P(Agreement, robust_hits_are_those_of_brute_force_bit_for_bit) {
  compare_with_brute_force<Precision::kRobust>();
}

TEST_P(Agreement, fast_hits_are_those_of_brute_force_bit_for_bit) {
  compare_with_brute_force<Precision::kFast>();
}

// Products of coordinates of such meshes are denormal or 0 in float.
TEST_P(Agreement, tiny_meshes_lose_no_hit_to_underflow) {
  test::Random random(test::seed_or(18));
  for (const int exponent : {-30, -42, -54, -60, -63, -66, -69, -72, -76, -90}) {
    TriangleMesh mesh = test::jittered_icosphere(2, 5);
    const float scale = std::ldexp(1.F, exponent);
    for (Vec3f& p : mesh.positions) p *= scale;
    const auto shared = test::share(std::move(mesh));
    const Result<Blas> blas = Blas::build(shared, GetParam().options);
    const Result<Blas> reference = Blas::build(shared, {.kind = StructureKind::kBruteForce});
    ASSERT_TRUE(blas.ok() && reference.ok());
    for (int i = 0; i < 300; ++i) {
      // From inside to a vertex, the middle of an edge, or anywhere.
      const auto corners = shared->corners(random.below(std::uint32_t(shared->triangle_count())));
      const Vec3d origin = 0.3 * double(scale) * random.in_box(1.0);
      const double share = 0.5 * double(random.below(3));
      const Vec3d target = glm::mix(Vec3d(corners[0]), Vec3d(corners[1]), share);
      const Vec3d towards = i % 4 == 0 ? random.direction() : (target - origin) / double(scale);
      RayCase ray;
      ray.ray = {origin, towards};
      const Hit want = closest<Precision::kRobust>(*reference, ray);
      const Hit got = closest<Precision::kRobust>(*blas, ray);
      ASSERT_TRUE(want.valid()) << "2^" << exponent << ", ray " << i << " left a closed mesh";
      ASSERT_EQ(got.primitive_id, want.primitive_id) << "2^" << exponent << ", ray " << i;
      ASSERT_TRUE(same_bits(got.t, want.t)) << "2^" << exponent << ", ray " << i;
      ASSERT_TRUE(any<Precision::kRobust>(*blas, ray)) << "2^" << exponent << ", ray " << i;
    }
  }
}

TEST_P(Agreement, an_empty_mesh_is_never_hit) {
  const Result<Blas> blas = Blas::build(test::share({}), GetParam().options);
  ASSERT_TRUE(blas.ok());
  EXPECT_TRUE(blas->validate().ok());
  EXPECT_TRUE(blas->bounds().empty());
  // Prepared for another box, so that the structure itself is asked.
  mesh::ObjectRay ray;
  ASSERT_TRUE(ray.prepare({{0, 0, -2}, {0, 0, 1}}, {Vec3f(-1.F), Vec3f(1.F)}));
  Hit best;
  EXPECT_FALSE(blas->intersect<Precision::kRobust>(ray, best));
  EXPECT_FALSE(blas->occluded<Precision::kRobust>(ray, best.t));
}

TEST_P(Agreement, at_the_same_distance_the_smaller_instance_and_primitive_win) {
  const auto mesh = test::share(test::repeated(test::quad_grid(8), 5));
  const Blas blas = Blas::build(mesh, GetParam().options).value();
  mesh::ObjectRay ray;
  ASSERT_TRUE(ray.prepare({{0.3, 0.4, 1.0}, {0.0, 0.0, -1.0}}, blas.bounds()));
  ray.instance_id = 7;
  Hit first;
  ASSERT_TRUE(blas.intersect<Precision::kRobust>(ray, first));
  EXPECT_EQ(first.t, 1.0);
  EXPECT_LT(first.primitive_id, 128U) << "a later copy of the grid won";

  Hit of_smaller_instance{1.0, 0.25, 0.5, 6, 4000};
  EXPECT_FALSE(blas.intersect<Precision::kRobust>(ray, of_smaller_instance));
  EXPECT_EQ(of_smaller_instance.instance_id, 6U);
  Hit of_larger_instance{1.0, 0.25, 0.5, 8, 0};
  EXPECT_TRUE(blas.intersect<Precision::kRobust>(ray, of_larger_instance));
  EXPECT_EQ(of_larger_instance.instance_id, 7U);
  EXPECT_EQ(of_larger_instance.primitive_id, first.primitive_id);
}

TEST_P(Agreement, no_ray_leaves_a_closed_mesh_through_an_edge_or_a_vertex) {
  Random random(test::seed_or(23));
  struct Closed {
    TriangleMesh mesh;
    Vec3d inside;
    int rays;  // few at the tip of the fan, where each is within rounding of 500 triangles
  };
  for (const float offset : {0.F, 1e6F}) {
    for (const Closed& closed : {Closed{test::jittered_icosphere(4, 9), Vec3d(0.0), 10000},
                                 Closed{test::torus(60, 30), {1.0, 0.0, 0.0}, 10000},
                                 Closed{test::needle_fan(1000), Vec3d(0.0), 500}}) {
      const auto mesh = test::share(test::translated(closed.mesh, Vec3f(offset)));
      const Blas blas = Blas::build(mesh, GetParam().options).value();
      std::size_t leaks = 0;
      const int rays = offset == 0.F ? closed.rays : closed.rays / 10;  // wide pads cull little there
      for (int i = 0; i < rays; ++i) {
        const auto corners = mesh->corners(random.below(std::uint32_t(mesh->triangle_count())));
        const double s = i % 2 != 0 ? random.uniform() : 0.0;
        const Vec3d target = Vec3d(corners[0]) + s * (Vec3d(corners[1]) - Vec3d(corners[0]));
        const Vec3d origin = closed.inside + Vec3d(double(offset)) + random.in_box(0.03);
        leaks += std::size_t(!any<Precision::kRobust>(blas, {{origin, target - origin}}));
      }
      EXPECT_EQ(leaks, 0U) << mesh->triangle_count() << " triangles at offset " << offset;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Structures, Agreement, testing::ValuesIn(structure_cases()),
                         [](const auto& structure) { return structure.param.name; });

}  // namespace
}  // namespace gridcast::blas
