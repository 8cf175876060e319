#pragma once
// Speed against accuracy: every structure in every precision, and Embree as it is used natively, on classes
// of rays, against the exact reference.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/blas/blas.h"
#include "core/error.h"
#include "core/measure/accuracy.h"
#include "core/measure/ray_classes.h"
#include "core/measure/scenes.h"
#include "core/scene/scene.h"

namespace gridcast::measure {

/// Brute force is measured on scenes of at most this many triangles in the world.
inline constexpr std::uint64_t kMaxBruteForceTriangles = 2000;

struct TradeoffOptions {
  std::vector<RayClass> classes{kAllRayClasses.begin(), kAllRayClasses.end()};
  /// Empty: wide_bvh, compact_bvh, bvh, kd_tree, embree, and brute_force on small scenes.
  std::vector<blas::StructureKind> structures;
  std::vector<Precision> precisions{Precision::kFast, Precision::kRobust, Precision::kExact};
  std::size_t accuracy_rays = 20'000;  ///< a class, compared with the exact answers
  std::size_t speed_rays = 100'000;    ///< a class, timed
  std::size_t repeat = 5;              ///< timings that the median is taken of
  std::size_t threads = 1;             ///< that are timed
  std::uint64_t seed = 1;
  std::optional<View> view;  ///< none: from a corner of the scene's box
  std::stop_token stop;
};

/// One method on one class of rays: a point of the chart.
struct TradeoffRow {
  std::string engine;     ///< gridcast or embree
  std::string structure;  ///< ours by name; embree_native for the yardstick
  std::string precision;  ///< fast, robust, exact; Embree: default, robust
  RayClass ray_class = RayClass::kRandom;
  std::string entry;  ///< batch; Embree: single, packet16 or packet16_coherent, whichever was faster
  std::uint64_t timed_rays = 0;
  double mrays_per_s = 0.0;         ///< median
  double spread = 0.0;              ///< of the timings, see spread()
  double bytes_per_triangle = 0.0;  ///< trees and top level by stored triangles, without the vertices
  double build_s = 0.0;             ///< from data to answers, once
  Accuracy accuracy;
  Rate image_difference;  ///< pixels that show another triangle, of a picture of 128 x 128; same in all
                          ///< classes
  bool on_front = false;  ///< no other method of the class is as fast and as right, and better in one
};

struct TradeoffReport {
  std::uint64_t stored_triangles = 0, world_triangles = 0, instances = 0;
  std::size_t meshes = 0, closed_meshes = 0;
  double diagonal = 0.0;  ///< of the scene's box, metres
  TradeoffOptions options;
  std::vector<TradeoffRow> rows;   ///< by class, then as measured
  std::vector<std::string> notes;  ///< what was left out, one sentence each
};

/// Builds and measures. Rays are floats, the same for all. Speeds are medians of interleaved repetitions; the
/// accuracy comes from separate runs over its own rays, so that checking costs no speed. Errors: those of
/// building, kInvalidArgument (nothing to hit, no method left), kCancelled.
[[nodiscard]] Result<TradeoffReport> measure_tradeoffs(const scene::SceneData& data,
                                                       const TradeoffOptions& options,
                                                       const scene::ProgressCallback& progress);

}  // namespace gridcast::measure
