#pragma once

#include "core/measure/bench.h"

namespace gridcast::server {

/// Poses that a crowd takes in a second.
inline constexpr double kCrowdUpdatesPerSecond = 30.0;

/// The section `crowd`: two clients cast rays in binary over HTTP, at the posed scene and at the still one in
/// turns. `crowd` is a measure::crowd_scene.
[[nodiscard]] Status bench_crowd(const measure::BenchScene& crowd, const measure::BenchOptions& options,
                                 measure::Report& report, const scene::ProgressCallback& progress);

}  // namespace gridcast::server
