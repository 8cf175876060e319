// The loops that tracing spends its time in, one by one, through the interfaces that everybody uses.
// Counters: ns is per test or per ray.

#include <memory>
#include <vector>

#include <benchmark/benchmark.h>

#include "core/blas/blas.h"
#include "core/measure/meshes.h"
#include "core/measure/random.h"
#include "core/measure/scenes.h"
#include "core/mesh/object_ray.h"
#include "core/mesh/triangle_test.h"
#include "core/scene/scene.h"
#include "core/tlas/top_level.h"

namespace gridcast {
namespace {

using measure::Random;

/// Enough for branches not to be learned by heart, few enough for the first-level cache.
constexpr std::size_t kCount = 512;
constexpr std::uint64_t kSeed = 7;

/// Rays from around a unit cube to points in it.
std::vector<Ray> rays_into_cube() {
  Random random(kSeed);
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < kCount; ++i) {
    const Vec3d origin = 3.0 * random.direction();
    rays.push_back({origin, random.in_box(1.0) - origin});
  }
  return rays;
}

std::vector<mesh::ObjectRay> prepared_rays(const Bounds3f& bounds) {
  std::vector<mesh::ObjectRay> prepared;
  for (const Ray& ray : rays_into_cube()) {
    mesh::ObjectRay one;
    if (!one.prepare(ray, bounds)) continue;
    one.instance_id = 0;
    one.excluded_primitive = kInvalidId;
    prepared.push_back(one);
  }
  return prepared;
}

constexpr Vec3f kOne{1.F};

void prepare_object_ray(benchmark::State& state) {
  const std::vector<Ray> rays = rays_into_cube();
  const Bounds3f bounds{-kOne, kOne};
  mesh::ObjectRay prepared;
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    benchmark::DoNotOptimize(prepared.prepare(rays[i++ % kCount], bounds));
    benchmark::ClobberMemory();
  }
}
BENCHMARK(prepare_object_ray);

void slab_test(benchmark::State& state) {
  const auto rays = prepared_rays({-kOne, kOne});
  const Vec3f lower{-0.3F, -0.4F, -0.2F}, upper{0.4F, 0.3F, 0.5F};
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    float enter = 0.F;
    benchmark::DoNotOptimize(mesh::intersect_box(rays[i++ % rays.size()], lower, upper, 1e30F, enter));
    benchmark::DoNotOptimize(enter);
  }
}
BENCHMARK(slab_test);

template <Precision kPrecision>
void triangle_test(benchmark::State& state) {
  const mesh::TriangleMesh soup = measure::soup_mesh(kCount, kSeed);
  const auto rays = prepared_rays({-kOne, kOne});
  mesh::TriangleHit hit{};
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    const auto [p0, p1, p2] = soup.corners(std::uint32_t(i % kCount));
    benchmark::DoNotOptimize(mesh::intersect_triangle<kPrecision>(rays[i % rays.size()], p0, p1, p2, hit));
    benchmark::DoNotOptimize(hit);
    ++i;
  }
}
BENCHMARK(triangle_test<Precision::kRobust>)->Name("triangle_test/robust");
BENCHMARK(triangle_test<Precision::kFast>)->Name("triangle_test/fast");

/// One ray through a whole tree. With four triangles the tree is one leaf: what is measured is the filter of
/// a block, and the triangle test for what it lets through.
template <Precision kPrecision>
void tree(benchmark::State& state, blas::StructureKind kind) {
  const auto mesh =
      std::make_shared<const mesh::TriangleMesh>(measure::soup_mesh(std::size_t(state.range(0)), kSeed));
  const auto blas = blas::Blas::build(mesh, {kind});
  if (!blas) return state.SkipWithError("the tree cannot be built");
  const auto rays = prepared_rays(blas->bounds());
  std::size_t i = 0;
  for ([[maybe_unused]] auto _ : state) {
    Hit best;
    benchmark::DoNotOptimize(blas->intersect<kPrecision>(rays[i++ % rays.size()], best));
    benchmark::DoNotOptimize(best);
  }
}
void tree_robust(benchmark::State& state, blas::StructureKind kind) {
  tree<Precision::kRobust>(state, kind);
}
void tree_fast(benchmark::State& state, blas::StructureKind kind) {
  tree<Precision::kFast>(state, kind);
}
BENCHMARK_CAPTURE(tree_robust, wide_bvh, blas::StructureKind::kWideBvh)
    ->Arg(4)
    ->Arg(8)
    ->Arg(1000)
    ->Arg(100'000);
BENCHMARK_CAPTURE(tree_fast, wide_bvh, blas::StructureKind::kWideBvh)->Arg(4)->Arg(1000);
BENCHMARK_CAPTURE(tree_robust, compact_bvh, blas::StructureKind::kCompactBvh)
    ->Arg(4)
    ->Arg(1000)
    ->Arg(100'000);
BENCHMARK_CAPTURE(tree_robust, kd_tree, blas::StructureKind::kKdTree)->Arg(4)->Arg(1000)->Arg(100'000);

/// The walk alone: instances are found and boxes tested, no tree is entered.
void top_level_walk(benchmark::State& state) {
  const auto forest = measure::make_scene("I2", kSeed, 0.01);
  const auto scene = scene::build_scene(forest->data);
  if (!scene) return state.SkipWithError("the scene cannot be built");
  const Bounds3d bounds = (*scene)->bounds();
  Random random(kSeed);
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < kCount; ++i) {
    const Vec3d part{random.uniform(), random.uniform(), random.uniform()};
    rays.push_back({bounds.lower + part * bounds.extent(), random.direction()});
  }
  std::size_t i = 0, visited = 0;
  for ([[maybe_unused]] auto _ : state) {
    const Ray& ray = rays[i++ % kCount];
    (*scene)->top_level().traverse(ray, ray.tfar, [&](std::uint32_t) {
      ++visited;
      return ray.tfar;
    });
  }
  state.counters["instances_per_ray"] =
      benchmark::Counter(double(visited), benchmark::Counter::kAvgIterations);
}
BENCHMARK(top_level_walk);

}  // namespace
}  // namespace gridcast
