#include "server/signals.h"

#include <ctime>

#include <signal.h>
#include <unistd.h>

namespace gridcast::server {
namespace {

sigset_t watched_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  return set;
}

}  // namespace

SignalWatch::SignalWatch() {
  const sigset_t set = watched_signals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  // A client or a pipe that goes away is an error of write(), not the end of the program.
  ::signal(SIGPIPE, SIG_IGN);
  thread_ = std::jthread([this](const std::stop_token& ending) { run(ending); });
}

SignalWatch::~SignalWatch() = default;

void SignalWatch::run(const std::stop_token& ending) {
  const sigset_t set = watched_signals();
  while (!ending.stop_requested()) {
    const timespec period{0, 100'000'000};
    if (sigtimedwait(&set, nullptr, &period) < 0) continue;
    if (!stop_.request_stop()) _exit(kExitInterrupted);
  }
}

}  // namespace gridcast::server
