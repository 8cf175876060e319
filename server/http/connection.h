#pragma once
// One client's socket, read and written with total deadlines and byte budgets.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "server/http/http_head.h"
#include "server/http/http_types.h"

namespace gridcast::server {

struct ConnectionLimits {
  std::chrono::milliseconds head{10'000};        ///< from a head's first byte to its last
  std::chrono::milliseconds keep_alive{15'000};  ///< from an answer to the next head's first byte
  std::chrono::milliseconds stall{10'000};       ///< longest silence inside a body
  /// A whole body or answer gets `stall` and this rate; slower clients are cut.
  double min_bytes_per_s = 16.0 * 1024;
  std::size_t requests = 1000;  ///< then it is closed: none holds a thread for ever
};

/// Why a body could not be read.
struct BodyError {
  std::optional<proto::Problem> problem;  ///< none: the client is gone
};

/// What a look at a connection found.
enum class Arrived : std::uint8_t { kNotYet, kHead, kEnd };

class Connection {
 public:
  /// Owns the socket.
  Connection(int socket, const ConnectionLimits& limits);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Takes what has come, without waiting: a whole head (or more than one may have), the end, or neither yet.
  [[nodiscard]] Arrived look();
  /// The same, after waiting for something to come, `time` at most.
  [[nodiscard]] Arrived look_within(std::chrono::milliseconds time);
  /// The head that look() found; nothing before it is whole.
  [[nodiscard]] std::optional<std::variant<HttpHead, HeadError>> take_head();
  /// The same head, which stays to be taken; null before it is whole.
  [[nodiscard]] const std::variant<HttpHead, HeadError>* peek_head();
  /// Whether there is one, without a look at what has come since.
  [[nodiscard]] bool has_head() const {
    return peeked_ || head_end_ != buffer_.npos || buffer_.size() > kMaxHeadBytes;
  }
  /// As many heads as one connection may send have been taken.
  [[nodiscard]] bool is_used_up() const { return heads_taken_ >= limits_.requests; }

  /// After an answer: the wait for a next request begins now.
  void begin_wait();
  /// When that wait began, or the first byte of the head that is under way was seen.
  [[nodiscard]] Clock::time_point waits_since() const { return waits_since_; }
  /// When a wait for more is to be given up.
  [[nodiscard]] Clock::time_point waits_until() const;
  /// A head has begun and is not whole.
  [[nodiscard]] bool head_begun() const { return !draining_ && !buffer_.empty(); }

  /// The body that `head` announces, at most `max_bytes` (else 413); answers Expect: 100-continue first.
  [[nodiscard]] std::variant<std::string, BodyError> read_body(const HttpHead& head, std::size_t max_bytes);
  /// Gets a body's bytes as they come; a problem ends the reading.
  using TakePart = std::function<std::optional<proto::Problem>(std::string_view)>;
  /// The same, in parts that are not kept.
  [[nodiscard]] std::optional<BodyError> stream_body(const HttpHead& head, std::size_t max_bytes,
                                                     const TakePart& take);

  /// The same for a body of announced length that is read piece by piece: first this,
  [[nodiscard]] std::optional<BodyError> begin_pieces(const HttpHead& head, std::size_t max_bytes) {
    return begin_body(head, max_bytes);
  }
  /// then this as often as it takes: fills `to` with what comes next, of which there is as much by the head.
  /// Calls `before_wait` once when nothing is there yet.
  [[nodiscard]] std::optional<BodyError> read_next(std::span<char> to,
                                                   const std::function<void()>& before_wait);

  /// Whether the whole body that `head` announces has come.
  [[nodiscard]] bool has_body(const HttpHead& head) const;
  /// Drops the body that `head` announces, what is still to come of it as well; false, and nothing is
  /// dropped, when that may be much or never come.
  [[nodiscard]] bool skip_body(const HttpHead& head);

  /// False when the client is gone or too slow.
  [[nodiscard]] bool write(std::string_view bytes);

  /// Writes as much as goes at once, for those who are not waited for; false when that is not all.
  bool write_now(std::string_view bytes) const;
  /// The same for the last bytes of all: they leave with the end of the stream, in one packet, when
  /// begin_close() is called or this goes.
  bool write_last_now(std::string_view bytes) const;

  /// Begins to close, so that an answer sent before the client finished its body still arrives: ends our
  /// side; from now on looks throw away what still comes, for a moment (waits_until()).
  void begin_close();
  [[nodiscard]] bool closing() const { return draining_; }

  [[nodiscard]] int socket() const { return socket_; }

 private:
  [[nodiscard]] std::variant<HttpHead, HeadError> read_head();
  /// Appends what arrives within `until` to buffer_. False at the end of the stream or the time.
  [[nodiscard]] bool receive(Clock::time_point until);
  /// Before a body: its announced length, its deadline, Expect: 100-continue.
  [[nodiscard]] std::optional<BodyError> begin_body(const HttpHead& head, std::size_t max_bytes);
  [[nodiscard]] std::variant<std::string, BodyError> read_counted(std::size_t bytes);
  [[nodiscard]] std::optional<BodyError> stream_counted(std::size_t bytes, const TakePart& take);
  [[nodiscard]] std::optional<BodyError> stream_chunked(std::size_t max_bytes, const TakePart& take);
  /// A line without its CRLF, at most `max_bytes` long.
  [[nodiscard]] std::optional<std::string> read_line(std::size_t max_bytes);

  int socket_;
  ConnectionLimits limits_;
  std::string buffer_;                                       ///< received, not yet consumed
  std::size_t head_end_ = std::string::npos;                 ///< of the empty line in buffer_
  std::optional<std::variant<HttpHead, HeadError>> peeked_;  ///< read and not taken
  std::size_t heads_taken_ = 0;
  std::size_t to_skip_ = 0;  ///< of what comes next: a body that nobody wants
  bool draining_ = false;
  Clock::time_point waits_since_ = Clock::now();
  Clock::time_point body_deadline_;
};

}  // namespace gridcast::server
