#pragma once

#include <condition_variable>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>

namespace gridcast::server {

/// Lets a few heavy pieces of work run at once; the others wait. More at once would only share the same cores
/// and hold more memory.
class WorkGate {
 public:
  explicit WorkGate(std::size_t at_once) : free_(at_once) {}

  /// Opens the gate for the next one when it goes.
  class Permit {
   public:
    explicit Permit(WorkGate* gate) : gate_(gate) {}
    ~Permit() {
      if (gate_ != nullptr) gate_->leave();
    }
    Permit(Permit&& other) noexcept : gate_(other.gate_) { other.gate_ = nullptr; }
    Permit(const Permit&) = delete;
    Permit& operator=(const Permit&) = delete;
    Permit& operator=(Permit&&) = delete;

   private:
    WorkGate* gate_;
  };

  /// Waits for a place; nothing when `stop` came first.
  [[nodiscard]] std::optional<Permit> enter(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return free_ > 0; })) return std::nullopt;
    --free_;
    return Permit(this);
  }

 private:
  void leave() {
    {
      const std::lock_guard lock(mutex_);
      ++free_;
    }
    changed_.notify_one();
  }

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::size_t free_;
};

}  // namespace gridcast::server
