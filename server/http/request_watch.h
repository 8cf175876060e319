#pragma once

#include <condition_variable>
#include <list>
#include <mutex>
#include <thread>

#include "server/http/http_types.h"
#include "server/memory_budget.h"

namespace gridcast::server {

struct WatchedRequest {
  int socket = -1;
  Cancellation* target = nullptr;
  std::size_t body_bytes = 0;
};

/// Watches requests at work: cancels one when its deadline passes, or when its client has hung up.
/// A client that closes its sending side counts as gone once the work has lasted longer than one look
/// (kPeriod): plain TCP gives no way to tell the two apart. While the process is over its memory budget, one
/// request with a large body a look is cancelled, the largest first: better one less upload than no process.
class RequestWatch {
 public:
  explicit RequestWatch(const MemoryBudget* budget = nullptr);
  ~RequestWatch();
  RequestWatch(const RequestWatch&) = delete;
  RequestWatch& operator=(const RequestWatch&) = delete;

  /// Ends the watching of one request when it goes.
  class Guard {
   public:
    /// Its target outlives the guard.
    Guard(RequestWatch& watch, const WatchedRequest& request);
    ~Guard();
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;

   private:
    RequestWatch& watch_;
    std::list<WatchedRequest>::iterator entry_;
  };

  /// Cancels every request at work now, and every later one at once.
  void shut_down();

  static constexpr std::chrono::milliseconds kPeriod{50};

 private:
  void run();
  /// When to look again: at the next deadline, or after a period.
  [[nodiscard]] Clock::time_point look();
  void relieve_memory();

  const MemoryBudget* const budget_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::list<WatchedRequest> requests_;
  bool asleep_ = false;  ///< nobody to watch: whoever comes first wakes the thread
  bool shut_down_ = false;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace gridcast::server
