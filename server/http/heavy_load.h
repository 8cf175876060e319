#pragma once

#include <cstddef>
#include <mutex>
#include <optional>
#include <utility>

#include "server/http/http_types.h"

namespace gridcast::server {

/// How many questions with large bodies are worked on or wait for it. A queue that is longer than what can
/// soon be answered makes everybody wait and serves nobody more; so when there are some for each core, and
/// they would take longer than a moment at the pace of the last ones, further ones are refused at once (the
/// aim of "Controlling Queue Delay", Kathleen Nichols and Van Jacobson, 2012; here the delay is foreseen, so
/// that nobody waits before a refusal). Any thread may ask.
class HeavyLoad {
 public:
  /// `always`: so many are never too many, however long they take. `longest_wait`: others are, when all
  /// together take longer.
  explicit HeavyLoad(std::size_t always, std::chrono::milliseconds longest_wait = kLongestWait)
      : always_(always), longest_wait_ms_(double(longest_wait.count())) {}

  /// One that is counted, until this goes.
  class Place {
   public:
    explicit Place(HeavyLoad& load) : load_(&load) {}
    ~Place() {
      if (load_ != nullptr) load_->leave(Clock::now());
    }
    Place(Place&& other) noexcept : load_(std::exchange(other.load_, nullptr)) {}
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    Place& operator=(Place&&) = delete;

   private:
    HeavyLoad* load_;
  };
  /// Nothing when one more is to be refused.
  [[nodiscard]] std::optional<Place> try_take() {
    if (!try_enter(Clock::now())) return std::nullopt;
    return Place(*this);
  }

  /// Whether one more would be refused.
  [[nodiscard]] bool is_full() const {
    const std::lock_guard lock(mutex_);
    return is_full_locked();
  }
  /// Counts one more, until leave(); false when it is to be refused.
  [[nodiscard]] bool try_enter(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    if (is_full_locked()) return false;
    begin(now);
    return true;
  }
  /// One that is counted waits for its client: it takes nothing meanwhile, and keeps nobody out.
  void pause(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    if (--count_ == 0) worked_ms_ += ms_between(last_, now);
  }
  /// It goes on, however many others have come.
  void resume(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    begin(now);
  }
  void leave(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    // From the end of one to that of the next, while there was work: how long each one keeps the others.
    constexpr double kShare = 0.1;
    mean_ms_ += kShare * (worked_ms_ + ms_between(last_, now) - mean_ms_);
    worked_ms_ = 0.0;
    last_ = now;
    --count_;
  }

  static constexpr std::chrono::milliseconds kLongestWait{20};

 private:
  void begin(Clock::time_point now) {
    if (count_ == 0) last_ = now;
    ++count_;
  }
  [[nodiscard]] bool is_full_locked() const {
    return count_ >= always_ && double(count_) * mean_ms_ > longest_wait_ms_;
  }

  const std::size_t always_;
  const double longest_wait_ms_;
  mutable std::mutex mutex_;
  std::size_t count_ = 0;
  double mean_ms_ = 0.0;
  double worked_ms_ = 0.0;  ///< since the end of the last one, before all of them waited for their clients
  Clock::time_point last_;
};

}  // namespace gridcast::server
