#pragma once

#include "core/measure/bench.h"

namespace gridcast::server {

/// The section `serve`: closest hits in binary over HTTP from this process to itself, on the loopback
/// address, beside the same batch without HTTP.
[[nodiscard]] Status bench_serve(const measure::BenchScene& bench_scene, const measure::BenchOptions& options,
                                 measure::Report& report, const scene::ProgressCallback& progress);

}  // namespace gridcast::server
