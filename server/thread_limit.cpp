#include "server/thread_limit.h"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

namespace gridcast::server {

struct ThreadLimit::Control {
  tbb::global_control control;
};

ThreadLimit::ThreadLimit(std::size_t threads)
    : threads_(threads != 0 ? threads : std::size_t(tbb::this_task_arena::max_concurrency())),
      control_(std::make_unique<Control>(
          Control{tbb::global_control(tbb::global_control::max_allowed_parallelism, threads_)})) {}

ThreadLimit::~ThreadLimit() = default;

}  // namespace gridcast::server
