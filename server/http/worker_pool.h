#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace gridcast::server {

/// Threads for connections, and a bounded queue before them.
class WorkerPool {
 public:
  WorkerPool(std::size_t threads, std::size_t max_queued);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  /// False, and `task` is untouched, when every thread is busy and the queue is full.
  [[nodiscard]] bool try_enqueue(std::function<void()>& task);
  /// The same without the queue: false when no thread is free.
  [[nodiscard]] bool try_hand_over(std::function<void()>& task);
  /// Whether tasks wait for a thread.
  [[nodiscard]] bool is_behind() const;
  /// Runs what is queued, then ends the threads.
  void shut_down();

 private:
  [[nodiscard]] bool try_enqueue_beyond(std::function<void()>& task, std::size_t max_queued);
  void run();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;
  std::size_t max_queued_;
  std::size_t idle_ = 0;
  bool ending_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace gridcast::server
