#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <utility>
#include <vector>

#include "core/error.h"

namespace gridcast::server::store {

/// Group commit: whoever comes while a commit runs waits, and the first of these then commits for all.
class CommitQueue {
 public:
  using Work = std::function<Status()>;
  /// Commits a batch: sets each work's status; called by one thread at a time.
  using CommitBatch = std::function<void(const std::vector<std::pair<Work*, Status*>>& batch)>;

  explicit CommitQueue(CommitBatch commit) : commit_(std::move(commit)) {}

  /// Returns when `work` was committed, or refused.
  Status run(Work work) {
    Ticket ticket{std::move(work), ok_status(), false};
    std::unique_lock lock(mutex_);
    waiting_.push_back(&ticket);
    changed_.wait(lock, [&] { return ticket.done || !committing_; });
    if (ticket.done) return ticket.status;
    committing_ = true;
    const std::vector<Ticket*> batch = std::exchange(waiting_, {});
    lock.unlock();
    std::vector<std::pair<Work*, Status*>> works;
    works.reserve(batch.size());
    for (Ticket* one : batch) works.emplace_back(&one->work, &one->status);
    commit_(works);
    lock.lock();
    for (Ticket* one : batch) one->done = true;
    committing_ = false;
    changed_.notify_all();
    return ticket.status;
  }

 private:
  struct Ticket {
    Work work;
    Status status;
    bool done;
  };
  CommitBatch commit_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Ticket*> waiting_;
  bool committing_ = false;
};

}  // namespace gridcast::server::store
