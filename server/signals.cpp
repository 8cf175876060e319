#include "server/signals.h"

#include <ctime>
#include <initializer_list>
#include <utility>

#include <signal.h>
#include <unistd.h>

namespace gridcast::server {
namespace {

sigset_t set_of(std::initializer_list<int> signals) {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : signals) sigaddset(&set, signal);
  return set;
}

sigset_t ending_signals() {
  return set_of({SIGINT, SIGTERM});
}

/// Waits a moment for one of `set`.
bool has_come(const sigset_t& set) {
  const timespec period{0, 100'000'000};
  return sigtimedwait(&set, nullptr, &period) > 0;
}

}  // namespace

SignalWatch::SignalWatch() {
  const sigset_t set = ending_signals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  // A client or a pipe that goes away is an error of write(), not the end of the program.
  ::signal(SIGPIPE, SIG_IGN);
  thread_ = std::jthread([this](const std::stop_token& ending) { run(ending); });
}

SignalWatch::~SignalWatch() = default;

void SignalWatch::run(const std::stop_token& ending) {
  const sigset_t set = ending_signals();
  // What another watch waits for must not come here and end the program.
  const sigset_t hangup = set_of({SIGHUP});
  pthread_sigmask(SIG_BLOCK, &hangup, nullptr);
  while (!ending.stop_requested())
    if (has_come(set) && !stop_.request_stop()) _exit(kExitInterrupted);
}

HangupWatch::HangupWatch(std::function<void()> at_hangup) {
  const sigset_t hangup = set_of({SIGHUP});
  pthread_sigmask(SIG_BLOCK, &hangup, nullptr);
  thread_ = std::jthread([hangup, at_hangup = std::move(at_hangup)](const std::stop_token& ending) {
    while (!ending.stop_requested())
      if (has_come(hangup)) at_hangup();
  });
}

}  // namespace gridcast::server
