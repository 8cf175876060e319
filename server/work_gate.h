#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <list>
#include <mutex>
#include <optional>
#include <stop_token>

namespace gridcast::server {

/// Lets a few pieces of work run at once; the others wait in the order of their arrival. For heavy work: more
/// at once would only share the same cores and hold more memory. With one place: writers that take turns.
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

  [[nodiscard]] std::size_t waiting() const {
    const std::lock_guard lock(mutex_);
    return waiting_.size();
  }

  /// A place when one is free and nobody waits for it.
  [[nodiscard]] std::optional<Permit> try_enter() {
    const std::lock_guard lock(mutex_);
    if (free_ == 0 || !waiting_.empty()) return std::nullopt;
    take_place();
    return Permit(this);
  }

  /// Work that was inside at some time since the gate was built, and that which has left.
  struct Counts {
    std::uint64_t entered = 0, left = 0;
  };
  [[nodiscard]] Counts counts() const {
    const std::lock_guard lock(mutex_);
    return counts_;
  }

  /// Waits for a place; nothing when `stop` came first.
  [[nodiscard]] std::optional<Permit> enter(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    if (free_ > 0 && waiting_.empty()) {
      take_place();
      return Permit(this);
    }
    Waiting self;
    const auto place = waiting_.insert(waiting_.end(), &self);
    const bool entered = self.called.wait(lock, stop, [&] { return free_ > 0 && waiting_.front() == &self; });
    waiting_.erase(place);
    if (entered) take_place();
    // Whoever is first now may have waited for this one alone.
    call_first();
    if (!entered) return std::nullopt;
    return Permit(this);
  }

 private:
  void take_place() {
    --free_;
    ++counts_.entered;
  }

  void leave() {
    const std::lock_guard lock(mutex_);
    ++free_;
    ++counts_.left;
    call_first();
  }

  /// Under mutex_. Nobody else is woken: with many who wait that would take longer than the work.
  void call_first() {
    if (free_ > 0 && !waiting_.empty()) waiting_.front()->called.notify_all();
  }

  struct Waiting {
    std::condition_variable_any called;
  };

  mutable std::mutex mutex_;
  std::list<Waiting*> waiting_;  ///< in order
  std::size_t free_;
  Counts counts_;
};

}  // namespace gridcast::server
