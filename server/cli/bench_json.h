#pragma once

#include <string>

#include "core/measure/bench.h"

namespace gridcast::server {

/// The whole report as one JSON object: `machine`, `settings`, and the rows of every section.
/// tests/bench/report.schema.json is its shape.
[[nodiscard]] std::string bench_json(const measure::Report& report, const measure::BenchOptions& options,
                                     double scene_size);

}  // namespace gridcast::server
