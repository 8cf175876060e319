#include "server/http/connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <utility>

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

constexpr std::size_t kReceiveBytes = std::size_t(256) << 10;
// A chunk's size in hexadecimal digits and its extensions; trailers are bounded the same way.
constexpr std::size_t kMaxChunkLine = 256;
constexpr std::chrono::milliseconds kDrain{500};
// Of an unwanted body, rather than closing its connection.
constexpr std::size_t kMostSkipped = std::size_t(64) << 10;
constexpr std::string_view kHeadEnd = "\r\n\r\n";

/// True when `socket` is ready for `events` before `until`.
bool wait_for(int socket, short events, Clock::time_point until) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
  pollfd entry{socket, events, 0};
  return ::poll(&entry, 1, int(std::clamp<long long>(left, 0, 60'000))) > 0;
}

/// What has come for nobody: TCP drops it without a copy.
Arrived throw_away(int socket) {
  constexpr std::size_t kMost = std::size_t(1) << 20;
  const ssize_t n = ::recv(socket, nullptr, kMost, MSG_DONTWAIT | MSG_TRUNC);
  const bool is_open = n > 0 || (n < 0 && (errno == EAGAIN || errno == EINTR));
  return is_open ? Arrived::kNotYet : Arrived::kEnd;
}

BodyError invalid_body(std::string detail) {
  return {Problem{ProblemCode::kInvalidRequest, std::move(detail), ""}};
}
BodyError large_body(std::size_t max_bytes) {
  return {Problem{ProblemCode::kPayloadTooLarge,
                  "the body is larger than " + std::to_string(max_bytes) + " bytes", ""}};
}
/// Appends every part to `text`.
Connection::TakePart kept_in(std::string& text) {
  return [&text](std::string_view part) {
    text.append(part);
    return std::optional<Problem>();
  };
}
/// After a failed wait or read: the time is up, or the client is gone.
BodyError broken_body(Clock::time_point deadline) {
  return Clock::now() >= deadline ? invalid_body("the body came too slowly") : BodyError{};
}

}  // namespace

Connection::Connection(int socket, const ConnectionLimits& limits) : socket_(socket), limits_(limits) {}

Connection::~Connection() {
  ::shutdown(socket_, SHUT_RDWR);
  ::close(socket_);
}

bool Connection::receive(Clock::time_point until) {
  if (!wait_for(socket_, POLLIN, until)) return false;
  const std::size_t before = buffer_.size();
  buffer_.resize(before + kReceiveBytes);
  const ssize_t n = ::recv(socket_, buffer_.data() + before, kReceiveBytes, 0);
  buffer_.resize(before + std::size_t(std::max<ssize_t>(n, 0)));
  return n > 0;
}

Arrived Connection::look() {
  if (draining_) return throw_away(socket_);
  if (has_head()) return Arrived::kHead;
  // Many wait at once: what each holds follows what it has sent.
  thread_local std::array<char, kMaxHeadBytes> piece;
  const ssize_t n = ::recv(socket_, piece.data(), piece.size(), MSG_DONTWAIT);
  if (n < 0 && (errno == EAGAIN || errno == EINTR)) return Arrived::kNotYet;
  if (n <= 0) return Arrived::kEnd;
  const std::size_t skipped = std::min(to_skip_, std::size_t(n));
  to_skip_ -= skipped;
  if (skipped == std::size_t(n)) return Arrived::kNotYet;
  if (buffer_.empty()) waits_since_ = Clock::now();
  const std::size_t seen = buffer_.size();
  buffer_.append(piece.data() + skipped, std::size_t(n) - skipped);
  head_end_ = buffer_.find(kHeadEnd, seen < 3 ? 0 : seen - 3);
  return has_head() ? Arrived::kHead : Arrived::kNotYet;
}

Arrived Connection::look_within(std::chrono::milliseconds time) {
  const Arrived at_once = look();
  if (at_once != Arrived::kNotYet || !wait_for(socket_, POLLIN, Clock::now() + time)) return at_once;
  return look();
}

Clock::time_point Connection::waits_until() const {
  if (draining_) return waits_since_ + kDrain;
  return waits_since_ + (buffer_.empty() ? limits_.keep_alive : limits_.head);
}

std::optional<std::variant<HttpHead, HeadError>> Connection::take_head() {
  if (!has_head()) return std::nullopt;
  ++heads_taken_;
  if (!peeked_) return read_head();
  return std::exchange(peeked_, std::nullopt);
}

const std::variant<HttpHead, HeadError>* Connection::peek_head() {
  if (!peeked_ && has_head()) peeked_ = read_head();
  return peeked_ ? &*peeked_ : nullptr;
}

std::variant<HttpHead, HeadError> Connection::read_head() {
  if (head_end_ == buffer_.npos || head_end_ + kHeadEnd.size() > kMaxHeadBytes) {
    const bool long_target = buffer_.find("\r\n") > kMaxTargetBytes;
    return long_target ? HeadError{ProblemCode::kUriTooLong, "the request target is too long"}
                       : HeadError{ProblemCode::kHeadersTooLarge, "the head is larger than 16 KiB"};
  }
  const std::string head = buffer_.substr(0, head_end_ + kHeadEnd.size());
  buffer_.erase(0, head.size());
  // What follows may be a body, a next head, or its beginning: known when the body is read.
  head_end_ = buffer_.npos;
  return parse_head(head);
}

void Connection::begin_wait() {
  waits_since_ = Clock::now();
  head_end_ = buffer_.find(kHeadEnd);
  if (buffer_.empty()) std::string().swap(buffer_);
}

std::optional<BodyError> Connection::begin_body(const HttpHead& head, std::size_t max_bytes) {
  if (head.framing == BodyFraming::kLength && head.content_length > max_bytes) return large_body(max_bytes);
  const std::size_t most = head.framing == BodyFraming::kLength ? head.content_length : max_bytes;
  body_deadline_ = Clock::now() + limits_.stall +
                   std::chrono::milliseconds(std::int64_t(1000.0 * double(most) / limits_.min_bytes_per_s));
  if (head.find("expect").value_or("") == "100-continue" && buffer_.empty() &&
      !write("HTTP/1.1 100 Continue\r\n\r\n"))
    return BodyError{};
  return std::nullopt;
}

std::variant<std::string, BodyError> Connection::read_body(const HttpHead& head, std::size_t max_bytes) {
  if (head.framing == BodyFraming::kNone) return std::string();
  if (auto error = begin_body(head, max_bytes)) return std::move(*error);
  if (head.framing == BodyFraming::kLength) return read_counted(head.content_length);
  std::string body;
  if (auto error = stream_chunked(max_bytes, kept_in(body))) return std::move(*error);
  return body;
}

std::optional<BodyError> Connection::stream_body(const HttpHead& head, std::size_t max_bytes,
                                                 const TakePart& take) {
  if (head.framing == BodyFraming::kNone) return std::nullopt;
  if (auto error = begin_body(head, max_bytes)) return error;
  return head.framing == BodyFraming::kLength ? stream_counted(head.content_length, take)
                                              : stream_chunked(max_bytes, take);
}

bool Connection::has_body(const HttpHead& head) const {
  return head.framing == BodyFraming::kNone ||
         (head.framing == BodyFraming::kLength && head.content_length <= buffer_.size());
}

bool Connection::skip_body(const HttpHead& head) {
  const std::size_t here = std::min<std::size_t>(head.content_length, buffer_.size());
  const std::size_t to_come = head.content_length - here;
  // Who expects a 100 first may leave the body out.
  if (head.framing == BodyFraming::kChunked || to_come > kMostSkipped || (to_come > 0 && head.find("expect")))
    return false;
  buffer_.erase(0, here);
  to_skip_ = to_come;
  return true;
}

std::variant<std::string, BodyError> Connection::read_counted(std::size_t bytes) {
  std::string body = buffer_.substr(0, bytes);
  buffer_.erase(0, body.size());
  std::size_t filled = body.size();
  // Memory follows what has arrived, not what was announced; straight into its place, without a copy.
  while (filled < bytes) {
    const Clock::time_point until = std::min(body_deadline_, Clock::now() + limits_.stall);
    if (!wait_for(socket_, POLLIN, until)) return broken_body(until);
    const std::size_t room = std::min(bytes - filled, std::max<std::size_t>(kReceiveBytes, filled));
    if (body.size() < filled + room) body.resize(filled + room);
    const ssize_t n = ::recv(socket_, body.data() + filled, room, 0);
    if (n <= 0) return broken_body(Clock::time_point::max());
    filled += std::size_t(n);
  }
  return body;
}

std::optional<BodyError> Connection::read_next(std::span<char> to, const std::function<void()>& before_wait) {
  std::size_t filled = buffer_.copy(to.data(), to.size());
  buffer_.erase(0, filled);
  bool has_waited = false;
  while (filled < to.size()) {
    const ssize_t n = ::recv(socket_, to.data() + filled, to.size() - filled, MSG_DONTWAIT);
    if (n > 0) {
      filled += std::size_t(n);
      continue;
    }
    if (n == 0 || (errno != EAGAIN && errno != EINTR)) return broken_body(Clock::time_point::max());
    if (!std::exchange(has_waited, true)) before_wait();
    const Clock::time_point until = std::min(body_deadline_, Clock::now() + limits_.stall);
    if (!wait_for(socket_, POLLIN, until)) return broken_body(until);
  }
  return std::nullopt;
}

std::optional<BodyError> Connection::stream_counted(std::size_t bytes, const TakePart& take) {
  while (bytes > 0) {
    const Clock::time_point until = std::min(body_deadline_, Clock::now() + limits_.stall);
    if (buffer_.empty() && !receive(until)) return broken_body(until);
    const std::size_t n = std::min(bytes, buffer_.size());
    if (auto problem = take(std::string_view(buffer_).substr(0, n))) return BodyError{std::move(problem)};
    buffer_.erase(0, n);
    bytes -= n;
  }
  return std::nullopt;
}

std::optional<std::string> Connection::read_line(std::size_t max_bytes) {
  std::size_t end = buffer_.find("\r\n");
  while (end == buffer_.npos) {
    if (buffer_.size() > max_bytes || !receive(std::min(body_deadline_, Clock::now() + limits_.stall)))
      return std::nullopt;
    end = buffer_.find("\r\n");
  }
  if (end > max_bytes) return std::nullopt;
  std::string line = buffer_.substr(0, end);
  buffer_.erase(0, end + 2);
  return line;
}

std::optional<BodyError> Connection::stream_chunked(std::size_t max_bytes, const TakePart& take) {
  std::size_t room = max_bytes;
  const BodyError malformed = invalid_body("malformed chunked body");
  while (true) {
    const auto line = read_line(kMaxChunkLine);
    if (!line) return malformed;
    const std::string_view digits = std::string_view(*line).substr(0, line->find(';'));
    std::size_t size = 0;
    // from_chars takes no sign and no prefix here; 15 digits cannot overflow.
    const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), size, 16);
    if (digits.empty() || digits.size() > 15 || digits[0] == '-' ||
        parsed.ptr != digits.data() + digits.size())
      return malformed;
    if (size == 0) break;
    if (size > room) return large_body(max_bytes);
    room -= size;
    if (auto error = stream_counted(size, take)) return error;
    std::string end;
    if (auto error = stream_counted(2, kept_in(end))) return error;
    if (end != "\r\n") return malformed;
  }
  // Trailer fields are read and dropped.
  for (std::size_t i = 0; i < kMaxHeaders; ++i) {
    const auto line = read_line(kMaxChunkLine);
    if (!line) break;
    if (line->empty()) return std::nullopt;
  }
  return malformed;
}

bool Connection::write(std::string_view bytes) {
  const Clock::time_point until =
      Clock::now() + limits_.stall +
      std::chrono::milliseconds(std::int64_t(1000.0 * double(bytes.size()) / limits_.min_bytes_per_s));
  while (!bytes.empty()) {
    const ssize_t n = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n > 0) {
      bytes.remove_prefix(std::size_t(n));
      continue;
    }
    if (n == 0 || (errno != EAGAIN && errno != EINTR)) return false;
    if (!wait_for(socket_, POLLOUT, std::min(until, Clock::now() + limits_.stall))) return false;
  }
  return true;
}

bool Connection::write_now(std::string_view bytes) const {
  return ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT) == ssize_t(bytes.size());
}

bool Connection::write_last_now(std::string_view bytes) const {
  constexpr int kHow = MSG_NOSIGNAL | MSG_DONTWAIT | MSG_MORE;
  return ::send(socket_, bytes.data(), bytes.size(), kHow) == ssize_t(bytes.size());
}

void Connection::begin_close() {
  ::shutdown(socket_, SHUT_WR);
  draining_ = true;
  begin_wait();
}

}  // namespace gridcast::server
