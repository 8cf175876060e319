#pragma once

#include <cstddef>
#include <memory>

namespace gridcast::server {

/// Bounds the threads that builds, queries and renders share, as long as it lives. 0: every core.
class ThreadLimit {
 public:
  explicit ThreadLimit(std::size_t threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

  [[nodiscard]] std::size_t threads() const { return threads_; }

 private:
  struct Control;
  std::size_t threads_;
  std::unique_ptr<Control> control_;
};

}  // namespace gridcast::server
