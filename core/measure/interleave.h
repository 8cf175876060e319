#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "core/error.h"
#include "core/measure/bench.h"
#include "core/measure/statistics.h"

namespace gridcast::measure {

/// One contender of a comparison.
struct Timed {
  std::function<Status()> run;   ///< timed
  std::function<void()> before;  ///< not timed; may be empty
  std::function<void()> after;   ///< not timed; may be empty
  Samples seconds;
};

/// Runs every contender once to warm up, then options.repeat times, one after the other, on `threads`
/// threads. kCancelled when stopped; else the first error of a contender.
[[nodiscard]] Status interleave(std::vector<Timed>& contenders, std::size_t threads, ClockKind clock,
                                const BenchOptions& options, const scene::ProgressCallback& progress);

}  // namespace gridcast::measure
