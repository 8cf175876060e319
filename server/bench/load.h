#pragma once

#include "core/measure/bench.h"

namespace gridcast::server {

/// The section `load`: a server with the limits of `gridcast serve`, under clients of the same process that
/// ask for more than it can do, send slowly, and go away.
[[nodiscard]] Status bench_load(const measure::BenchScene& bench_scene, const measure::BenchOptions& options,
                                measure::Report& report, const scene::ProgressCallback& progress);

}  // namespace gridcast::server
