// Builds every structure and traces ray sets through it, each in a call of its own for a profiler to count:
// see tests/bench/instructions.sh. On one thread, since callgrind's collection is switched on per thread.
//   build/release/bin/bench_instructions [SCENE] [SIZE] [RAYS] [SEED]
//   build/release/bin/bench_instructions --about     what counts depend on: the compiler, the instruction set

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <oneapi/tbb/task_arena.h>

#include "core/math/instruction_set.h"
#include "core/measure/answers.h"
#include "core/measure/embree_yardstick.h"
#include "core/measure/ray_sets.h"
#include "core/measure/scenes.h"
#include "core/scene/scene.h"
#include "core/scene/trace.h"

#if defined(__clang__)
#define GRIDCAST_COUNTED_ONCE gnu::noinline
#else
#define GRIDCAST_COUNTED_ONCE gnu::noipa  // nor a copy of another name
#endif
/// What is counted; the profiler knows it by this name.
extern "C" [[GRIDCAST_COUNTED_ONCE]] void gridcast_counted(const std::function<void()>& work) {
  work();
}

namespace gridcast {
namespace {

using measure::RaySet;

constexpr blas::StructureKind kStructures[] = {blas::StructureKind::kWideBvh,
                                               blas::StructureKind::kCompactBvh, blas::StructureKind::kBvh,
                                               blas::StructureKind::kKdTree, blas::StructureKind::kEmbree};
constexpr measure::EmbreeMode kModes[] = {measure::EmbreeMode::kDefault, measure::EmbreeMode::kRobust};

/// Prints what the next count will be of, and makes the call.
void count(const char* structure, const char* entry, const RaySet& rays, const std::function<void()>& work) {
  const auto set = std::string(to_string(rays.kind));
  std::printf("%s %s %s %zu\n", structure, entry, set.c_str(), rays.size());
  gridcast_counted(work);
}

/// Of all meshes, each alone.
void count_builds(const scene::SceneData& data) {
  struct Build {
    const char* name;
    blas::BuildOptions options;
  };
  const Build builds[] = {
      {"wide_bvh", {.kind = blas::StructureKind::kWideBvh}},
      {"wide_bvh_fast", {.kind = blas::StructureKind::kWideBvh, .quality = blas::BuildQuality::kFast}},
      {"kd_tree", {.kind = blas::StructureKind::kKdTree}}};
  std::size_t triangles = 0;
  for (const auto& mesh : data.meshes) triangles += mesh->triangle_count();
  for (const Build& build : builds) {
    std::printf("%s build triangles %zu\n", build.name, triangles);
    gridcast_counted([&] {
      for (const auto& mesh : data.meshes) (void)blas::Blas::build(mesh, build.options);
    });
  }
}

/// One line: the compiler with its version, and the instructions that kernels use here.
void print_about() {
#if defined(__clang__)
  std::printf("clang-%d.%d", __clang_major__, __clang_minor__);
#else
  std::printf("gcc-%d.%d", __GNUC__, __GNUC_MINOR__);
#endif
#if !defined(__OPTIMIZE__)
  std::printf("-O0");
#endif
  std::printf(" %s\n", std::string(instruction_set()).c_str());
}

void count_ours(const char* name, const scene::Scene& scene, const RaySet& rays) {
  measure::Answers answers;
  answers.resize(rays.size(), query_of(rays.kind));
  count(name, "single", rays,
        [&] { trace_single(scene, rays, Precision::kRobust, 0, rays.size(), answers); });
  const scene::TraceOptions options{Precision::kRobust, HitField::kAll, {}, {}};
  count(name, "batch", rays, [&] {
    if (query_of(rays.kind) == measure::QueryKind::kAny)
      answers.occluded = scene::occluded(scene, rays.batch(), options).value();
    else
      answers.hits = scene::intersect(scene, rays.batch(), options).value();
  });
}

int run(const std::string& name, double size, std::size_t ray_count, std::uint64_t seed) {
  const auto made = measure::make_scene(name, seed, size);
  if (!made) return std::fprintf(stderr, "%s\n", made.error().message.c_str()), 2;
  count_builds(made->data);
  std::vector<RaySet> sets;
  for (const blas::StructureKind kind : kStructures) {
    const auto scene = scene::build_scene(made->data, {{kind}, {}, {}});
    if (!scene) return std::fprintf(stderr, "%s\n", scene.error().message.c_str()), 1;
    const measure::RaySetMaker maker(**scene, made->view, ray_count, seed);
    for (const measure::RaySetKind set : measure::kAllRaySets) {
      const auto rays = maker.make(set);
      if (!rays) return std::fprintf(stderr, "%s\n", rays.error().message.c_str()), 1;
      count_ours(std::string(blas::to_string(kind)).c_str(), **scene, *rays);
      if (sets.size() < measure::kAllRaySets.size()) sets.push_back(*rays);
    }
  }
  for (const measure::EmbreeMode mode : kModes) {
    const auto scene = measure::EmbreeScene::build(made->data, {.mode = mode});
    if (!scene) return std::fprintf(stderr, "%s\n", scene.error().message.c_str()), 1;
    const std::string who = "Embree_" + std::string(to_string(mode));
    for (const RaySet& rays : sets) {
      measure::EmbreeAnswers answers(rays.size());
      count(who.c_str(), "single", rays, [&] {
        (*scene)->trace(rays.rows, 0, rays.size(), query_of(rays.kind), measure::EmbreeEntry::kSingle,
                        answers);
      });
    }
  }
  return 0;
}

}  // namespace
}  // namespace gridcast

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "--about") return gridcast::print_about(), 0;
  const std::string name = argc > 1 ? argv[1] : "S1";
  const double size = argc > 2 ? std::atof(argv[2]) : 1.0;
  const auto rays = std::size_t(argc > 3 ? std::atoll(argv[3]) : 2000);
  const auto seed = std::uint64_t(argc > 4 ? std::atoll(argv[4]) : 1);
  if (!(size > 0.0 && size <= 1.0) || rays == 0)
    return std::fputs("see the head of instructions.cpp\n", stderr), 2;
  oneapi::tbb::task_arena arena(1, 1);
  return arena.execute([&] { return gridcast::run(name, size, rays, seed); });
}
