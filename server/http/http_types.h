#pragma once
// Requests and answers as the routes see them: plain values, no library types.

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
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

/// The body of a request while it comes, for routes that take it so (BodyArrival).
class IncomingBody {
 public:
  IncomingBody() = default;
  virtual ~IncomingBody() = default;
  IncomingBody(const IncomingBody&) = delete;
  IncomingBody& operator=(const IncomingBody&) = delete;

  /// Still to come; what was announced, as long as nothing was read.
  [[nodiscard]] virtual std::size_t bytes_left() const = 0;
  /// Fills `to` with what comes next, of which there is as much. Where it has to wait for the client it calls
  /// `before_wait` first, so that whoever waits for nothing has the cores; the deadline of the request stands
  /// still meanwhile. A problem when no more will come: the answer to the request, if anybody is there.
  [[nodiscard]] virtual std::optional<proto::Problem> read(std::span<char> to,
                                                           const std::function<void()>& before_wait) = 0;
};

struct HttpRequest {
  std::string method;
  std::string path;                             ///< raw, still percent-encoded
  proto::QueryParameters query;                 ///< decoded, in the order given
  std::map<std::string, std::string> headers;   ///< names in lower case; repeated ones joined by ", "
  std::map<std::string, std::string> captures;  ///< decoded segments named by the route's pattern
  std::string body;
  std::string request_id;
  std::shared_ptr<access::Caller> caller = nullptr;  ///< whose token came; null: whoever reaches the port
  IncomingBody* incoming = nullptr;  ///< when set, the body, of which nothing was read; `body` is empty

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

/// A body in parts that lie where they were made.
struct BodyParts {
  std::vector<std::span<const std::byte>> parts;
  std::shared_ptr<const void> owner;  ///< of what they view

  [[nodiscard]] std::size_t bytes() const {
    std::size_t sum = 0;
    for (const auto& part : parts) sum += part.size();
    return sum;
  }
};

struct HttpResponse {
  int status = 200;
  std::string content_type;
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
  StreamBody stream = nullptr;  ///< when set, the body; `body` is empty
  BodyParts in_parts = {};      ///< when there are any, the body; `body` is empty
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
  /// `begun`: what a client's deadline counts from.
  explicit Cancellation(Clock::time_point deadline = Clock::time_point::max(),
                        Clock::time_point begun = Clock::now())
      : begun_(begun), deadline_(deadline.time_since_epoch().count()) {}

  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }
  [[nodiscard]] CancelReason reason() const { return reason_.load(); }
  void cancel(CancelReason reason) {
    CancelReason none = CancelReason::kNone;
    if (reason_.compare_exchange_strong(none, reason)) source_.request_stop();
  }

  [[nodiscard]] Clock::time_point deadline() const {
    return Clock::time_point(Clock::duration(deadline_.load()));
  }
  /// A client may ask for a sooner deadline than the server's, never for a later one. What it has waited and
  /// what was read of it until now counts.
  void stop_within(std::chrono::duration<double, std::milli> time) {
    const auto sooner = begun_ + std::chrono::duration_cast<Clock::duration>(time);
    if (sooner < deadline()) deadline_ = sooner.time_since_epoch().count();
  }
  /// Deadlines count from now on: of work that waited without one. By the thread that asks for deadlines.
  void begin() { begun_ = Clock::now(); }
  void lift_deadline() { deadline_ = Clock::time_point::max().time_since_epoch().count(); }
  /// After it was lifted for a while.
  void set_deadline(Clock::time_point deadline) { deadline_ = deadline.time_since_epoch().count(); }

 private:
  std::stop_source source_;
  Clock::time_point begun_;
  std::atomic<CancelReason> reason_{CancelReason::kNone};
  std::atomic<Clock::rep> deadline_;
};

}  // namespace gridcast::server
