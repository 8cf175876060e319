// Builds a tree over a large terrain and casts rays at it; prints the largest memory that the process had.
//   build/release/bin/bench_memory [TRIANGLES] [STRUCTURE] [SEED]

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <utility>

#include <sys/resource.h>

#include "core/blas/blas.h"
#include "core/measure/meshes.h"
#include "core/measure/random.h"
#include "core/mesh/object_ray.h"

namespace gridcast {
namespace {

constexpr int kRays = 10'000;

/// The most that was in memory at any time so far, in bytes; Linux counts in KiB.
double peak_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * double(usage.ru_maxrss);
}

/// Rays straight down within the middle of the square, none of which may miss; the number that hit.
int hits_from_above(const blas::Blas& tree, std::uint64_t seed) {
  measure::Random random(seed);
  int hits = 0;
  for (int i = 0; i < kRays; ++i) {
    const Vec3d origin{random.uniform() - 0.5, 10.0, random.uniform() - 0.5};
    mesh::ObjectRay ray;
    if (!ray.prepare({origin, {0.0, -1.0, 0.0}}, tree.bounds())) continue;
    ray.instance_id = 0;
    ray.excluded_primitive = kInvalidId;
    Hit best;
    hits += tree.intersect<Precision::kRobust>(ray, best) ? 1 : 0;
  }
  return hits;
}

int run(std::size_t triangles, const char* structure, std::uint64_t seed) {
  const auto kind = blas::parse_structure_kind(structure);
  if (!kind) return std::fprintf(stderr, "%s\n", kind.error().message.c_str()), 2;
  auto terrain = std::make_shared<const mesh::TriangleMesh>(measure::terrain_mesh(triangles, seed));
  constexpr double kGiB = 0x1p30;
  std::printf("%zu triangles, mesh %.2f GiB, peak %.2f GiB\n", terrain->triangle_count(),
              double(terrain->memory_bytes()) / kGiB, peak_bytes() / kGiB);
  for (const blas::BuildQuality quality : {blas::BuildQuality::kFast, blas::BuildQuality::kDefault}) {
    const std::clock_t start = std::clock();
    const auto tree = blas::Blas::build(terrain, {.kind = *kind, .quality = quality});
    if (!tree) return std::fprintf(stderr, "%s\n", tree.error().message.c_str()), 1;
    const double taken_s = double(std::clock() - start) / CLOCKS_PER_SEC;
    const int hits = hits_from_above(*tree, seed);
    std::printf("%s, %s: %.1f s of processor time, %.1f bytes a triangle, %d of %d rays hit, peak %.2f GiB\n",
                structure, quality == blas::BuildQuality::kFast ? "fast" : "default", taken_s,
                double(tree->stats().memory_bytes) / double(terrain->triangle_count()), hits, kRays,
                peak_bytes() / kGiB);
    if (hits != kRays) return 1;
  }
  return 0;
}

}  // namespace
}  // namespace gridcast

int main(int argc, char** argv) {
  const auto triangles = std::size_t(argc > 1 ? std::atoll(argv[1]) : 10'000'000);
  const auto seed = std::uint64_t(argc > 3 ? std::atoll(argv[3]) : 1);
  if (triangles == 0) return std::fputs("see the head of memory.cpp\n", stderr), 2;
  return gridcast::run(triangles, argc > 2 ? argv[2] : "wide_bvh", seed);
}
