#pragma once
// Answers that are kept for those who send a request again because they did not get one.

#include <chrono>
#include <cstddef>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "server/http/http_types.h"
#include "server/work_gate.h"

namespace gridcast::server {

/// The answers of requests by their Idempotency-Key, bounded in number, bytes and time; the oldest go first.
/// In memory: a restart forgets them. Any thread may call.
class KeptAnswers {
 public:
  KeptAnswers(std::size_t max_count, std::size_t max_bytes, std::chrono::duration<double, std::milli> keep)
      : max_count_(max_count),
        max_bytes_(max_bytes),
        keep_(std::chrono::duration_cast<Clock::duration>(keep)) {}

  /// What became of one key. Those who send it at once take turns.
  struct Entry {
    explicit Entry(std::string first_request) : request(std::move(first_request)) {}
    const std::string request;  ///< that it was first sent with
    WorkGate turn{1};
    std::optional<HttpResponse> answer;  ///< read and set by who has the turn
  };

  /// The entry of `key`: a new one when it is not known, else one whose `request` may be another. To be
  /// closed.
  [[nodiscard]] std::shared_ptr<Entry> open(const std::string& key, const std::string& request);
  /// Keeps `answer`, unless it alone is over the limit. For who has the turn.
  void keep(const std::string& key, const std::shared_ptr<Entry>& entry, const HttpResponse& answer);
  /// Ends the use of an opened entry. One that nobody uses and that has no answer is forgotten.
  void close(const std::string& key, std::shared_ptr<Entry> entry);

 private:
  struct Kept {
    std::string key;
    std::size_t bytes = 0;
    Clock::time_point forget_at;
  };
  void forget_oldest();

  const std::size_t max_count_, max_bytes_;
  const Clock::duration keep_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Entry>> entries_;
  std::deque<Kept> kept_;  ///< those with an answer, the oldest first
  std::size_t bytes_ = 0;
};

}  // namespace gridcast::server
