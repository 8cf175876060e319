#pragma once
// One client's socket, read and written with total deadlines and byte budgets.

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "server/http_head.h"
#include "server/http_types.h"

namespace gridcast::server {

struct ConnectionLimits {
  std::chrono::milliseconds head{10'000};  ///< from a head's first byte to its last
  std::chrono::milliseconds keep_alive{15'000};
  std::chrono::milliseconds stall{10'000};  ///< longest silence inside a body
  /// A whole body or answer gets `stall` and this rate; slower clients are cut.
  double min_bytes_per_s = 16.0 * 1024;
};

/// Why a body could not be read.
struct BodyError {
  std::optional<proto::Problem> problem;  ///< none: the client is gone
};

class Connection {
 public:
  /// `stopping` is asked while idle: true ends the wait for a next request.
  Connection(int socket, const ConnectionLimits& limits, std::function<bool()> stopping);

  /// The next request's head; nothing when the client closed, stayed idle, or the server is stopping.
  [[nodiscard]] std::optional<std::variant<HttpHead, HeadError>> read_head();
  /// When the first byte of that head was seen.
  [[nodiscard]] Clock::time_point head_started() const { return head_started_; }

  /// The body that `head` announces, at most `max_bytes` (else 413); answers Expect: 100-continue first.
  [[nodiscard]] std::variant<std::string, BodyError> read_body(const HttpHead& head, std::size_t max_bytes);

  /// False when the client is gone or too slow.
  [[nodiscard]] bool write(std::string_view bytes);

  /// Closes so that an answer sent before the client finished its body still arrives: ends our side, then
  /// throws away what still comes for a moment.
  void close_gently();

  [[nodiscard]] int socket() const { return socket_; }

 private:
  /// Appends what arrives within `until` to buffer_. False at the end of the stream or the time.
  [[nodiscard]] bool receive(Clock::time_point until);
  [[nodiscard]] std::variant<std::string, BodyError> read_counted(std::size_t bytes);
  [[nodiscard]] std::variant<std::string, BodyError> read_chunked(std::size_t max_bytes);
  /// A line without its CRLF, at most `max_bytes` long.
  [[nodiscard]] std::optional<std::string> read_line(std::size_t max_bytes);
  [[nodiscard]] bool take(std::size_t bytes, std::string& into);

  int socket_;
  ConnectionLimits limits_;
  std::function<bool()> stopping_;
  std::string buffer_;  ///< received, not yet consumed
  Clock::time_point head_started_;
  Clock::time_point body_deadline_;
};

}  // namespace gridcast::server
