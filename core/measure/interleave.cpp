#include "core/measure/interleave.h"

#include <oneapi/tbb/task_arena.h>

namespace gridcast::measure {

Status interleave(std::vector<Timed>& contenders, std::size_t threads, ClockKind clock,
                  const BenchOptions& options, const scene::ProgressCallback& progress) {
  oneapi::tbb::task_arena arena(int(threads), 1);
  const double steps = double((options.repeat + 1) * contenders.size());
  double done = 0.0;
  for (std::size_t round = 0; round <= options.repeat; ++round) {
    for (Timed& contender : contenders) {
      if (options.stop.stop_requested()) return Error{ErrorCode::kCancelled, "the benchmark was stopped", ""};
      if (contender.before) contender.before();
      Status status = ok_status();
      const double taken = seconds(clock, [&] { arena.execute([&] { status = contender.run(); }); });
      if (!status) return status;
      if (round > 0) contender.seconds.push_back(taken);
      if (contender.after) contender.after();
      done += 1.0;
      if (progress) progress(done / steps);
    }
  }
  return ok_status();
}

}  // namespace gridcast::measure
