#pragma once

#include <functional>
#include <stop_token>
#include <thread>

namespace gridcast::server {

/// Ctrl-C and SIGTERM as a stop request: the first one asks, the second one ends the program at once.
/// Make it before any other thread: they inherit the signals' masking, and one thread waits for them.
class SignalWatch {
 public:
  SignalWatch();
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  [[nodiscard]] std::stop_token token() const { return stop_.get_token(); }

 private:
  void run(const std::stop_token& ending);

  std::stop_source stop_;
  std::jthread thread_;
};

/// Calls `at_hangup` at every SIGHUP, on a thread of its own. Make it before threads other than
/// SignalWatch's.
class HangupWatch {
 public:
  explicit HangupWatch(std::function<void()> at_hangup);

 private:
  std::jthread thread_;
};

inline constexpr int kExitInterrupted = 130;  // 128 + SIGINT, as shells report it

}  // namespace gridcast::server
