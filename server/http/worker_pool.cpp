#include "server/http/worker_pool.h"

#include <utility>

namespace gridcast::server {

// A thread that has not begun yet is as good as one that waits.
WorkerPool::WorkerPool(std::size_t threads, std::size_t max_queued)
    : max_queued_(max_queued), idle_(threads) {
  threads_.reserve(threads);
  for (std::size_t i = 0; i < threads; ++i) threads_.emplace_back([this] { run(); });
}

WorkerPool::~WorkerPool() {
  shut_down();
}

bool WorkerPool::try_enqueue(std::function<void()>& task) {
  return try_enqueue_beyond(task, max_queued_);
}

bool WorkerPool::try_hand_over(std::function<void()>& task) {
  return try_enqueue_beyond(task, 0);
}

bool WorkerPool::is_behind() const {
  const std::lock_guard lock(mutex_);
  return tasks_.size() > idle_;
}

bool WorkerPool::try_enqueue_beyond(std::function<void()>& task, std::size_t max_queued) {
  {
    const std::lock_guard lock(mutex_);
    if (ending_ || tasks_.size() >= idle_ + max_queued) return false;
    tasks_.push_back(std::move(task));
  }
  changed_.notify_one();
  return true;
}

void WorkerPool::shut_down() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

void WorkerPool::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ending_ || !tasks_.empty(); });
    if (tasks_.empty()) return;
    --idle_;
    std::function<void()> task = std::move(tasks_.front());
    tasks_.pop_front();
    lock.unlock();
    task();
    task = nullptr;
    lock.lock();
    ++idle_;
  }
}

}  // namespace gridcast::server
