#include "server/http/request_watch.h"

#include <algorithm>

#include <poll.h>

namespace gridcast::server {
namespace {

/// Also behind bytes that nobody has read yet.
bool hung_up(int socket) {
  pollfd entry{socket, POLLRDHUP, 0};
  return ::poll(&entry, 1, 0) > 0;
}

}  // namespace

RequestWatch::RequestWatch(const MemoryBudget* budget) : budget_(budget), thread_([this] { run(); }) {}

RequestWatch::~RequestWatch() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

RequestWatch::Guard::Guard(RequestWatch& watch, const WatchedRequest& request) : watch_(watch) {
  const std::lock_guard lock(watch_.mutex_);
  if (watch_.shut_down_) request.target->cancel(CancelReason::kShutdown);
  watch_.requests_.push_front(request);
  entry_ = watch_.requests_.begin();
  // Otherwise it looks soon by itself: to wake a thread takes as long as a small request.
  if (watch_.asleep_) watch_.changed_.notify_all();
}

RequestWatch::Guard::~Guard() {
  const std::lock_guard lock(watch_.mutex_);
  watch_.requests_.erase(entry_);
}

void RequestWatch::shut_down() {
  const std::lock_guard lock(mutex_);
  shut_down_ = true;
  for (WatchedRequest& request : requests_) request.target->cancel(CancelReason::kShutdown);
}

void RequestWatch::run() {
  std::unique_lock lock(mutex_);
  Clock::time_point next = Clock::now();
  while (!ending_) {
    asleep_ = requests_.empty();
    if (asleep_) {
      changed_.wait(lock, [this] { return ending_ || !requests_.empty(); });
      next = Clock::now() + kPeriod;
    } else if (!changed_.wait_until(lock, next, [this] { return ending_; })) {
      next = look();
    }
  }
}

Clock::time_point RequestWatch::look() {
  const Clock::time_point now = Clock::now();
  Clock::time_point next = now + kPeriod;
  for (WatchedRequest& request : requests_) {
    if (now >= request.target->deadline())
      request.target->cancel(CancelReason::kDeadline);
    else if (request.target->reason() == CancelReason::kNone && hung_up(request.socket))
      request.target->cancel(CancelReason::kDisconnected);
    else
      next = std::min(next, request.target->deadline());
  }
  if (budget_ != nullptr && budget_->level() == MemoryBudget::Level::kFull) relieve_memory();
  return next;
}

void RequestWatch::relieve_memory() {
  WatchedRequest* largest = nullptr;
  for (WatchedRequest& request : requests_) {
    const bool counts =
        request.target->reason() == CancelReason::kNone && request.body_bytes > MemoryBudget::kSmallBytes;
    if (counts && (largest == nullptr || request.body_bytes > largest->body_bytes)) largest = &request;
  }
  if (largest != nullptr) largest->target->cancel(CancelReason::kMemory);
}

}  // namespace gridcast::server
