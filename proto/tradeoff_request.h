#pragma once
// The body of POST .../tradeoffs.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/ray.h"
#include "proto/limits.h"
#include "proto/parsed.h"

namespace gridcast::proto {

struct TradeoffRequest {
  std::vector<std::string> ray_classes;  ///< of kRayClassNames, each once, at least one
  std::vector<std::string> structures;  ///< of kBuiltStructureNames, each once; empty: all that fit the scene
  std::vector<Precision> precisions;    ///< each once, at least one
  std::size_t accuracy_rays = 20'000;   ///< a class, compared with the exact answers
  std::size_t speed_rays = 100'000;     ///< a class, timed
  std::size_t repeat = 5;               ///< timings that the median is taken of
  std::size_t threads = 1;              ///< that are timed
  std::uint64_t seed = 1;
  std::optional<double> deadline_ms;  ///< of the job's work
};

/// Rays traced in all: every method traces the timed rays once more to warm up.
[[nodiscard]] std::uint64_t traces(const TradeoffRequest& request);

/// JSON with members as above, all optional. Problems: out_of_range for counts over a limit, for more than
/// `max_threads`, and for a sweep that traces more rays than limits.tradeoff_traces in all.
[[nodiscard]] Parsed<TradeoffRequest> parse_tradeoff_request(std::string_view body, std::size_t max_threads,
                                                             const Limits& limits);

}  // namespace gridcast::proto
