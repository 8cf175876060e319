#pragma once

#include <cstddef>
#include <mutex>

#include "server/http_types.h"

namespace gridcast::server {

/// How many questions with large bodies are worked on or wait for it. A queue that is longer than what can
/// soon be answered makes everybody wait and serves nobody more; so when there are some for each core, and
/// they would take longer than a moment at the pace of the last ones, further ones are refused at once (the
/// aim of "Controlling Queue Delay", Kathleen Nichols and Van Jacobson, 2012; here the delay is foreseen, so
/// that nobody waits before a refusal). Any thread may ask.
class HeavyLoad {
 public:
  /// `always`: so many are never too many, however long they take.
  explicit HeavyLoad(std::size_t always) : always_(always) {}

  /// Whether one more would be refused.
  [[nodiscard]] bool is_full() const {
    const std::lock_guard lock(mutex_);
    return is_full_locked();
  }
  /// Counts one more, until leave(); false when it is to be refused.
  [[nodiscard]] bool try_enter(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    if (is_full_locked()) return false;
    if (count_ == 0) last_ = now;
    ++count_;
    return true;
  }
  void leave(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    // From the end of one to that of the next, while there was work: how long each one keeps the others.
    constexpr double kShare = 0.1;
    mean_ms_ += kShare * (ms_between(last_, now) - mean_ms_);
    last_ = now;
    --count_;
  }

  static constexpr double kLongestWaitMs = 20.0;

 private:
  [[nodiscard]] bool is_full_locked() const {
    return count_ >= always_ && double(count_) * mean_ms_ > kLongestWaitMs;
  }

  const std::size_t always_;
  mutable std::mutex mutex_;
  std::size_t count_ = 0;
  double mean_ms_ = 0.0;
  Clock::time_point last_;
};

}  // namespace gridcast::server
