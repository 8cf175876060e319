#pragma once
// The benchmark: runs contenders beside each other and fills a Report.

#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <vector>

#include "core/blas/blas.h"
#include "core/measure/ray_sets.h"
#include "core/measure/report.h"
#include "core/measure/scenes.h"
#include "core/scene/scene.h"

namespace gridcast::measure {

struct BenchOptions {
  std::vector<RaySetKind> sets{kAllRaySets.begin(), kAllRaySets.end()};
  std::vector<blas::StructureKind> structures{blas::StructureKind::kWideBvh, blas::StructureKind::kBvh,
                                              blas::StructureKind::kKdTree};
  std::vector<Precision> precisions{Precision::kRobust, Precision::kFast};
  std::vector<std::size_t> threads{1};
  std::vector<ClientCores> clients{ClientCores::kShared};
  std::size_t rays = 1'000'000;  ///< a set
  std::size_t repeat = 5;
  std::size_t frames = 24;  ///< of a deformation
  double phase_s = 2.0;     ///< that a crowd moves or stands still
  std::uint64_t seed = 1;
  std::stop_token stop;
};

/// Single rays and batches of every structure and precision, and Embree's ways, on every ray set of one
/// scene; appends to `report`. Repetitions of all contenders are interleaved. Errors: those of building the
/// scene, kCancelled.
[[nodiscard]] Status bench_rays(const BenchScene& bench_scene, const BenchOptions& options, Report& report,
                                const scene::ProgressCallback& progress);

/// Building and refitting the tree of the scene's first mesh, ours and Embree's.
[[nodiscard]] Status bench_builds(const BenchScene& bench_scene, const BenchOptions& options, Report& report,
                                  const scene::ProgressCallback& progress);
[[nodiscard]] Status bench_refits(const BenchScene& bench_scene, const BenchOptions& options, Report& report,
                                  const scene::ProgressCallback& progress);

/// Moving all and one in a hundred of the instances. Does nothing for a scene of one instance.
[[nodiscard]] Status bench_instances(const BenchScene& bench_scene, const BenchOptions& options,
                                     Report& report, const scene::ProgressCallback& progress);

/// The deformation set on the scene's first mesh: frame by frame an update through scene::apply_update, then
/// rays through the scene that it leaves, a fresh one of the same vertices, and Embree's trees, refitted only
/// and new. On one thread.
[[nodiscard]] Status bench_deformations(const BenchScene& bench_scene, const BenchOptions& options,
                                        Report& report, const scene::ProgressCallback& progress);

}  // namespace gridcast::measure
