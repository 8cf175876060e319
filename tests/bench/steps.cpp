// Whether steps counted on a few rays would judge a refitted tree better than its surface-area cost does, and
// what counting takes of a refit's time: over the deformation set, a tree that is only refitted. On one
// thread, thread CPU time.
//   build/release/bin/bench_steps [SCENE] [SIZE] [FRAMES] [REPETITIONS]

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <oneapi/tbb/task_arena.h>

#include "core/blas/triangle_boxes.h"
#include "core/blas/wide_bvh.h"
#include "core/blas/wide_steps.h"
#include "core/measure/bench.h"
#include "core/measure/deformation_set.h"
#include "core/measure/scenes.h"
#include "core/measure/statistics.h"

namespace gridcast {
namespace {

using Tree = std::shared_ptr<const blas::WideBvh>;
using measure::Samples;

/// As many as would be counted after a refit.
constexpr std::size_t kFew = 16;
/// What tells the truth; no more than the few where a ray takes so many steps.
constexpr std::size_t kMany = 2000;
constexpr double kLongWay = 2000.0;

/// Of one moment of a mesh.
struct Measures {
  double cost = 0.0, looseness = 0.0, few = 0.0, many = 0.0;
};

double ratio(double a, double b) {
  return b > 0.0 ? a / b : 1.0;
}

Tree built(const mesh::TriangleMesh& mesh) {
  return blas::WideBvh::build(mesh, {.spatial = blas::SpatialSplits::kAuto}, {}).value();
}

double steps_of(const blas::WideBvh& tree, std::size_t rays) {
  return blas::steps_per_ray(tree.nodes(), tree.blocks(), tree.root_bounds(), rays).value();
}

Measures measures_of(const blas::WideBvh& tree, const mesh::TriangleMesh& mesh) {
  blas::StructureStats stats;
  tree.add_stats(stats);
  const double boxes = blas::triangle_boxes_per_ray(mesh, mesh.bounds());
  const double few = steps_of(tree, kFew);
  return {stats.cost, ratio(stats.cost, boxes), few, few > kLongWay ? few : steps_of(tree, kMany)};
}

double us_of(const std::function<void()>& work) {
  return 1e6 * measure::seconds(measure::ClockKind::kThread, work);
}

void run(measure::Deformation deformation, const mesh::TriangleMesh& rest, std::size_t frames,
         int repetitions) {
  mesh::TriangleMesh mesh = rest;
  const auto pose = [&](std::size_t frame) {
    mesh.positions = deformed(deformation, rest.positions, double(frame) / double(frames), 1);
  };
  pose(0);
  Tree tree = built(mesh);
  const Measures first = measures_of(*tree, mesh);
  for (std::size_t frame = 1; frame <= frames; ++frame) {
    pose(frame);
    Samples refits, counts;
    for (int i = 0; i < repetitions; ++i) {
      refits.push_back(us_of([&] { tree = tree->refit(mesh).value(); }));
      counts.push_back(us_of([&] { (void)steps_of(*tree, kFew); }));
    }
    const Measures now = measures_of(*tree, mesh), fresh = measures_of(*built(mesh), mesh);
    std::printf("| %s %zu | %.2f, %.2f, %.2f | %.2f, %.2f, %.2f | %.0f, %.1f (%.1f %%) |\n",
                std::string(to_string(deformation)).c_str(), frame, ratio(now.cost, first.cost),
                ratio(now.looseness, first.looseness), ratio(now.few, first.few), ratio(now.cost, fresh.cost),
                ratio(now.few, fresh.few), ratio(now.many, fresh.many), measure::median(refits),
                measure::median(counts), 100.0 * ratio(measure::median(counts), measure::median(refits)));
    std::fflush(stdout);
  }
}

int run(const char* scene, double size, std::size_t frames, int repetitions) {
  const auto made = measure::make_scene(scene, 1, size);
  if (!made) return std::fprintf(stderr, "%s\n", made.error().message.c_str()), 1;
  const auto mesh = measure::first_mesh(made->data).meshes[0];
  std::printf("%s, %zu triangles, %d repetitions\n", scene, mesh->triangle_count(), repetitions);
  std::printf(
      "| deformation, frame | now by at build: cost, looseness, steps of %zu rays | by a new tree's: cost, "
      "steps of %zu rays, of %zu | us: refit, count |\n|---|---|---|---|\n",
      kFew, kFew, kMany);
  for (const measure::Deformation deformation : measure::kAllDeformations)
    run(deformation, *mesh, frames, repetitions);
  return 0;
}

}  // namespace
}  // namespace gridcast

int main(int argc, char** argv) {
  const char* scene = argc > 1 ? argv[1] : "S1";
  const double size = argc > 2 ? std::atof(argv[2]) : 1.0;
  const int frames = argc > 3 ? std::atoi(argv[3]) : 6;
  const int repetitions = argc > 4 ? std::atoi(argv[4]) : 5;
  if (!(size > 0.0 && size <= 1.0) || frames < 1 || repetitions < 1) {
    std::fputs("usage: bench_steps [SCENE] [SIZE, up to 1] [FRAMES] [REPETITIONS]\n", stderr);
    return 2;
  }
  int code = 0;
  oneapi::tbb::task_arena(1, 1).execute(
      [&] { code = gridcast::run(scene, size, std::size_t(frames), repetitions); });
  return code;
}
