#pragma once
// Requests and answers as the routes see them: plain values, no library types.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "proto/error_table.h"
#include "proto/query.h"

namespace gridcast::server {

namespace access {
class Caller;
}

using Clock = std::chrono::steady_clock;

inline double ms_between(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double, std::milli>(to - from).count();
}

struct HttpRequest {
  std::string method;
  std::string path;                             ///< raw, still percent-encoded
  proto::QueryParameters query;                 ///< decoded, in the order given
  std::map<std::string, std::string> headers;   ///< names in lower case; repeated ones joined by ", "
  std::map<std::string, std::string> captures;  ///< decoded segments named by the route's pattern
  std::string body;
  std::string request_id;
  std::shared_ptr<access::Caller> caller = nullptr;  ///< whose token came; null: whoever reaches the port

  [[nodiscard]] std::string header(const std::string& lower_case_name) const {
    const auto found = headers.find(lower_case_name);
    return found == headers.end() ? std::string() : found->second;
  }
  [[nodiscard]] const std::string& capture(const std::string& name) const { return captures.at(name); }
};

class Cancellation;
/// A body that is made when it is asked for, or what kept it from being made.
using MakeBody = std::function<std::variant<std::string, proto::Problem>(const Cancellation&)>;
/// Sends a part of a streamed body; false when the client is gone or too slow.
using WritePart = std::function<bool(std::string_view)>;
/// Makes a body while it is sent. Returns at its end, soon after a failed write or when cancelled (client
/// gone, server stopping); a request's deadline does not hold for it.
using StreamBody = std::function<void(const Cancellation&, const WritePart&)>;

struct HttpResponse {
  int status = 200;
  std::string content_type;
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
  StreamBody stream = nullptr;  ///< when set, the body; `body` is empty
  /// The same answer in other media types: whoever keeps it may give one of them instead.
  struct Form {
    std::string content_type, body;
    MakeBody make = nullptr;  ///< when set, the body, anew at each request; `body` is empty
  };
  std::vector<Form> other_forms = {};

  HttpResponse& with(std::string name, std::string value) {
    headers.emplace_back(std::move(name), std::move(value));
    return *this;
  }
};

/// Why a request's work was told to stop.
enum class CancelReason : std::uint8_t { kNone, kDeadline, kDisconnected, kShutdown, kRequested, kMemory };

/// The stop signal of one request and its deadline. Stops at most once; any thread may ask.
class Cancellation {
 public:
  explicit Cancellation(Clock::time_point deadline = Clock::time_point::max())
      : deadline_(deadline.time_since_epoch().count()) {}

  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }
  [[nodiscard]] CancelReason reason() const { return reason_.load(); }
  void cancel(CancelReason reason) {
    CancelReason none = CancelReason::kNone;
    if (reason_.compare_exchange_strong(none, reason)) source_.request_stop();
  }

  [[nodiscard]] Clock::time_point deadline() const {
    return Clock::time_point(Clock::duration(deadline_.load()));
  }
  /// A client may ask for a sooner deadline than the server's, never for a later one.
  void stop_within(std::chrono::duration<double, std::milli> time) {
    const auto sooner = Clock::now() + std::chrono::duration_cast<Clock::duration>(time);
    if (sooner < deadline()) deadline_ = sooner.time_since_epoch().count();
  }
  void lift_deadline() { deadline_ = Clock::time_point::max().time_since_epoch().count(); }

 private:
  std::stop_source source_;
  std::atomic<CancelReason> reason_{CancelReason::kNone};
  std::atomic<Clock::rep> deadline_;
};

}  // namespace gridcast::server
