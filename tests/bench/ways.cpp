// What a ray looks at in each structure on its way to its closest hit: nodes, leaves, triangles. Exact
// counts, by the program's own explanations of single rays (core/scene/explain.h); tests/bench/README.md has
// figures.
//   build/release/bin/bench_ways [SCENE] [SIZE] [RAYS] [SEED]

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "core/measure/ray_sets.h"
#include "core/measure/scenes.h"
#include "core/scene/explain.h"
#include "core/scene/scene.h"

namespace gridcast {
namespace {

constexpr blas::StructureKind kStructures[] = {blas::StructureKind::kWideBvh,
                                               blas::StructureKind::kCompactBvh, blas::StructureKind::kBvh,
                                               blas::StructureKind::kKdTree};
constexpr measure::RaySetKind kSets[] = {measure::RaySetKind::kPrimary, measure::RaySetKind::kDiffuse};
constexpr std::size_t kMaxSteps = 10'000'000;

/// A line of the table. False when a ray cannot be explained.
bool print(const std::string& structure, const scene::Scene& scene, const measure::RaySet& rays) {
  WayCounts sum;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto way = scene::explain(scene, rays.batch()[i], {.max_steps = kMaxSteps});
    if (!way) return std::fprintf(stderr, "%s\n", way.error().message.c_str()), false;
    sum.nodes += way->counts.nodes;
    sum.leaves += way->counts.leaves;
    sum.filtered_triangles += way->counts.filtered_triangles;
    sum.triangles += way->counts.triangles;
  }
  const auto mean = [&](std::uint64_t count) { return double(count) / double(rays.size()); };
  std::printf("%-12s %-10s %9.2f %9.2f %9.2f %9.2f\n", structure.c_str(),
              std::string(to_string(rays.kind)).c_str(), mean(sum.nodes), mean(sum.leaves),
              mean(sum.filtered_triangles), mean(sum.triangles));
  return true;
}

int run(const std::string& name, double size, std::size_t ray_count, std::uint64_t seed) {
  const auto made = measure::make_scene(name, seed, size);
  if (!made) return std::fprintf(stderr, "%s\n", made.error().message.c_str()), 2;
  std::printf("%-12s %-10s %9s %9s %9s %9s\n", "a ray's", "set", "nodes", "leaves", "filtered", "tested");
  for (const blas::StructureKind kind : kStructures) {
    const auto scene = scene::build_scene(made->data, {{kind}, {}, {}});
    if (!scene) return std::fprintf(stderr, "%s\n", scene.error().message.c_str()), 1;
    const measure::RaySetMaker maker(**scene, made->view, ray_count, seed);
    for (const measure::RaySetKind set : kSets) {
      const auto rays = maker.make(set);
      if (!rays) return std::fprintf(stderr, "%s\n", rays.error().message.c_str()), 1;
      if (!print(std::string(blas::to_string(kind)), **scene, *rays)) return 1;
    }
  }
  return 0;
}

}  // namespace
}  // namespace gridcast

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "S1";
  const double size = argc > 2 ? std::atof(argv[2]) : 1.0;
  const auto rays = std::size_t(argc > 3 ? std::atoll(argv[3]) : 10'000);
  const auto seed = std::uint64_t(argc > 4 ? std::atoll(argv[4]) : 1);
  if (!(size > 0.0 && size <= 1.0) || rays == 0) return std::fputs("see the head of ways.cpp\n", stderr), 2;
  return gridcast::run(name, size, rays, seed);
}
