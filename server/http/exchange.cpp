#include "server/http/exchange.h"

#include <algorithm>
#include <cctype>
#include <exception>
#include <utility>

#include "proto/content_coding.h"
#include "proto/media_type.h"
#include "proto/zstd.h"
#include "server/access/access_control.h"
#include "server/http/answer_coding.h"
#include "server/http/problem.h"
#include "server/http/small_request.h"
#include "server/http/url.h"
#include "server/log.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

/// The client's X-Request-Id when it is a short plain token, else one of ours.
std::string request_id_of(const HttpHead& head) {
  static std::atomic<std::uint64_t> counter{0};
  const std::string given = head.find("x-request-id").value_or("");
  const bool plain =
      !given.empty() && given.size() <= 64 && std::all_of(given.begin(), given.end(), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_' || c == '.';
      });
  return plain ? given : std::string("r").append(std::to_string(++counter));
}

// What a body may grow to while it is worked on: a model's meshes beside its text and the trees that are
// built over them; a query's answer, and its rays in another order.
constexpr std::uint64_t kBytesPerModelByte = 8;
constexpr std::uint64_t kBytesPerQueryByte = 4;

// Smaller bodies come whole: they are here before their work has begun.
constexpr std::size_t kBytesInPieces = std::size_t(4) << 20;

Problem too_many_bodies() {
  return {ProblemCode::kOverloaded, "too many large bodies at once", ""};
}

/// Bytes that are counted among those of bodies as long as this lives: what decoders hold.
class SharedBytes {
 public:
  explicit SharedBytes(std::atomic<std::size_t>& all) : all_(all) {}
  ~SharedBytes() { all_ -= mine_; }
  SharedBytes(const SharedBytes&) = delete;
  SharedBytes& operator=(const SharedBytes&) = delete;

  /// False when all would be more than `most`; a few are never too many.
  [[nodiscard]] bool grow_to(std::size_t bytes, std::size_t most) {
    if (bytes <= mine_) return true;
    all_ += bytes - mine_;
    mine_ = bytes;
    return all_ <= most || bytes <= kSmallDecoder;
  }

 private:
  static constexpr std::size_t kSmallDecoder = std::size_t(512) << 10;
  std::atomic<std::size_t>& all_;
  std::size_t mine_ = 0;
};

/// Of a body whose Content-Encoding is one that is taken.
bool is_packed(const HttpRequest& request) {
  return proto::parse_content_encoding(request.header("content-encoding")) == proto::BodyCoding::kZstd;
}

/// Of a small request.
bool has_large_answer(const Route& route) {
  return route.pattern.ends_with("/rays/all") || route.pattern.ends_with("/renders") ||
         route.pattern.ends_with("/tradeoffs");
}

}  // namespace

HttpResponse Exchange::run() {
  record_.method = head_.method;
  record_.request_id = request_id_of(head_);
  HttpResponse response;
  try {
    response = answer();
  } catch (const std::bad_alloc&) {
    response = problem_response({ProblemCode::kOverloaded, "not enough memory for this request", ""});
  } catch (const std::exception& error) {
    // The text of an exception stays here: it may name files or hold the client's bytes.
    log_error(error.what());
    response = problem_response({ProblemCode::kInternal, "an unexpected error; see the server's log", ""});
  }
  shared_.body_bytes_in_flight -= reserved_bytes_;
  response.with("X-Request-Id", record_.request_id);
  response.with("X-Content-Type-Options", "nosniff");
  if (const auto trace = head_.find("traceparent"); trace && trace->size() <= 128)
    response.with("traceparent", *trace);
  record_.status = response.status;
  record_.bytes_out = response.body.size() + response.in_parts.bytes();
  record_.ms = ms_between(started_, Clock::now());
  if (!response.stream) guard_.reset();
  return response;
}

void Exchange::stream(const StreamBody& body, const WritePart& write) {
  cancellation_->lift_deadline();
  try {
    body(*cancellation_, [&](std::string_view part) {
      record_.bytes_out += part.size();
      return write(part);
    });
  } catch (const std::exception& error) {
    log_error(error.what());
    must_close_ = true;
  }
  client_gone_ = cancellation_->reason() == CancelReason::kDisconnected;
  record_.ms = ms_between(started_, Clock::now());
  guard_.reset();
}

HttpResponse Exchange::answer() {
  HttpRequest request;
  const Route* route = nullptr;
  std::optional<Problem> problem = prepare(request, route);
  if (!problem) problem = read_body(*route, request);
  if (!problem) return admit_and_handle(*route, request);
  // An unread body would be taken for the next request.
  if (head_.framing == BodyFraming::kChunked || head_.content_length != 0) must_close_ = true;
  HttpResponse response = problem_response(*problem);
  if (problem->code == ProblemCode::kMethodNotAllowed) response.with("Allow", allowed_);
  if (problem->code == ProblemCode::kUnsupportedEncoding)
    response.with("Accept-Encoding", std::string(proto::kZstdCoding));
  return response;
}

std::optional<Problem> Exchange::prepare(HttpRequest& request, const Route*& route) {
  const std::size_t mark = head_.target.find('?');
  request.method = head_.method;
  request.path = head_.target.substr(0, mark);
  request.request_id = record_.request_id;
  for (const auto& [name, value] : head_.headers) {
    std::string& joined = request.headers[name];
    joined.append(joined.empty() ? "" : ", ").append(value);
  }
  Router::Match match = shared_.router.match(request.method, request.path);
  route = match.route;
  allowed_ = match.allowed;
  request.captures = std::move(match.captures);
  if (auto problem = admit(request, route)) return problem;
  if (route == nullptr && match.allowed.empty())
    return Problem{ProblemCode::kNotFound, "there is nothing at this path", ""};
  if (route == nullptr)
    return Problem{ProblemCode::kMethodNotAllowed, "this path does not take the method; it takes " + allowed_,
                   ""};
  record_.route = route->pattern;
  if (mark != std::string::npos) {
    auto query = parse_query(std::string_view(head_.target).substr(mark + 1));
    if (!query) return Problem{ProblemCode::kInvalidRequest, "malformed escape in the query string", "?"};
    request.query = std::move(*query);
  }
  if (proto::choose_answer_coding(request.header("accept-encoding")) == proto::AnswerCoding::kNone)
    return Problem{ProblemCode::kNotAcceptable, "answers leave as they are, or as zstd", "Accept-Encoding"};
  return std::nullopt;
}

std::optional<Problem> Exchange::admit(HttpRequest& request, const Route* route) {
  if (shared_.options.access == nullptr) return std::nullopt;
  auto admitted = shared_.options.access->admit(request, route == nullptr ? std::string() : route->pattern);
  if (auto* problem = std::get_if<Problem>(&admitted)) return std::move(*problem);
  request.caller = std::move(std::get<std::shared_ptr<access::Caller>>(admitted));
  record_.caller = access::owner_of(request);
  return std::nullopt;
}

std::variant<std::size_t, Problem> Exchange::body_limit(const Route& route,
                                                        const HttpRequest& request) const {
  if (!proto::parse_content_encoding(request.header("content-encoding")))
    return Problem{ProblemCode::kUnsupportedEncoding, "the only Content-Encoding taken is zstd, once",
                   "Content-Encoding"};
  if (route.accepts.empty()) return Problem{ProblemCode::kInvalidRequest, "this request takes no body", ""};
  const auto type = proto::parse_media_type(request.header("content-type"));
  if (type) {
    for (const AcceptedBody& accepted : route.accepts)
      if (accepted.media_type == type->essence) return accepted.max_bytes;
  }
  std::string known;
  for (const AcceptedBody& accepted : route.accepts)
    known.append(known.empty() ? "" : ", ").append(accepted.media_type);
  return Problem{ProblemCode::kUnsupportedMediaType, "Content-Type must be one of: " + known, "Content-Type"};
}

std::optional<Problem> Exchange::read_body(const Route& route, HttpRequest& request) {
  const bool has_body = head_.framing == BodyFraming::kChunked || head_.content_length != 0;
  const bool may_have_none = route.accepts.empty() || request.method == "DELETE";
  if (!has_body && may_have_none) return check_memory(route, 0);
  if (head_.framing == BodyFraming::kNone)
    return Problem{ProblemCode::kLengthRequired, "Content-Length or chunked coding is required",
                   "Content-Length"};
  auto limit = body_limit(route, request);
  if (auto* problem = std::get_if<Problem>(&limit)) return std::move(*problem);
  const std::size_t max_bytes = std::get<std::size_t>(limit);
  const bool packed = is_packed(request);
  // What a packed body of unknown length takes is told while it comes.
  const std::size_t wanted = head_.framing == BodyFraming::kLength
                                 ? std::min<std::size_t>(head_.content_length, max_bytes)
                                 : (packed ? 0 : max_bytes);
  if (auto problem = reserve(route, wanted)) return problem;
  if (comes_in_pieces(route, request)) {
    auto error = connection_.begin_pieces(head_, max_bytes);
    if (error) return body_problem(std::move(*error));
    incoming_bytes_ = head_.content_length;
    return std::nullopt;
  }
  const Clock::time_point before = Clock::now();
  auto body = packed ? read_zstd(route, max_bytes) : connection_.read_body(head_, max_bytes);
  transfer_ = Clock::now() - before;
  if (auto* error = std::get_if<BodyError>(&body)) return body_problem(std::move(*error));
  request.body = std::move(std::get<std::string>(body));
  if (!packed) record_.bytes_in = request.body.size();
  return std::nullopt;
}

Problem Exchange::body_problem(BodyError error) {
  if (error.problem) return std::move(*error.problem);
  if (shared_.under_way.has_ended_receiving()) return cancelled_problem(CancelReason::kShutdown);
  client_gone_ = true;
  return cancelled_problem(CancelReason::kDisconnected);
}

std::optional<Problem> Exchange::reserve(const Route& route, std::size_t bytes) {
  if (auto problem = check_memory(route, bytes)) return problem;
  const std::size_t more = bytes - reserved_bytes_;
  reserved_bytes_ = bytes;
  if ((shared_.body_bytes_in_flight += more) > shared_.options.max_body_bytes_in_flight && bytes > 65'536)
    return too_many_bodies();
  return std::nullopt;
}

std::variant<std::string, BodyError> Exchange::read_zstd(const Route& route, std::size_t max_bytes) {
  proto::ZstdDecoder decoder(max_bytes);
  std::string body;
  const auto keep = [&](std::string_view decoded) -> std::optional<Problem> {
    const std::size_t bytes = body.size() + decoded.size();
    if (bytes > reserved_bytes_)
      if (auto problem = reserve(route, std::min(max_bytes, 2 * bytes))) return problem;
    body.append(decoded);
    return std::nullopt;
  };
  SharedBytes window(shared_.body_bytes_in_flight);
  const auto decode = [&](std::string_view encoded) -> std::optional<Problem> {
    record_.bytes_in += encoded.size();
    if (auto problem = decoder.decode(encoded, keep)) return problem;
    if (!window.grow_to(decoder.held_bytes(), shared_.options.max_body_bytes_in_flight))
      return too_many_bodies();
    return std::nullopt;
  };
  if (auto error = connection_.stream_body(head_, max_bytes, decode)) return std::move(*error);
  if (auto problem = decoder.finish()) return BodyError{std::move(problem)};
  return body;
}

std::optional<Problem> Exchange::check_memory(const Route& route, std::size_t body_bytes) const {
  const MemoryBudget* memory = shared_.options.memory;
  // Looking stays possible, and deleting is the way out.
  if (memory == nullptr || route.method == "GET" || route.method == "DELETE") return std::nullopt;
  const bool stays = access::need_of(route.method, route.pattern).role != access::Role::kRead;
  const std::uint64_t more = std::uint64_t(body_bytes) * (stays ? kBytesPerModelByte : kBytesPerQueryByte);
  const MemoryBudget::Level level = memory->level(shared_.body_bytes_in_flight + more);
  const bool is_much = stays || body_bytes > MemoryBudget::kSmallBytes || has_large_answer(route);
  if (level == MemoryBudget::Level::kFree || (level == MemoryBudget::Level::kTight && !is_much))
    return std::nullopt;
  if (stays)
    return Problem{ProblemCode::kMemoryFull, "the server's memory is nearly used up; delete scenes", ""};
  return Problem{ProblemCode::kOverloaded, "the server's memory is nearly used up", ""};
}

bool Exchange::comes_in_pieces(const Route& route, const HttpRequest& request) const {
  return route.arrival == BodyArrival::kOnTheWay && head_.framing == BodyFraming::kLength &&
         head_.content_length >= kBytesInPieces && !is_packed(request) && is_heavy_request(head_);
}

HttpResponse Exchange::admit_and_handle(const Route& route, HttpRequest& request) {
  if (!is_heavy_request(head_)) return handle(route, request);
  if (!place_)
    if (auto place = shared_.heavy.try_take()) place_.emplace(std::move(*place));
  if (!place_) {
    must_close_ = incoming_bytes_ > 0;
    return problem_response({ProblemCode::kOverloaded, "too many requests", ""});
  }
  HttpResponse response = handle(route, request);
  place_.reset();
  return response;
}

HttpResponse Exchange::handle(const Route& route, HttpRequest& request) {
  const Clock::time_point begun = started_ + transfer_;
  cancellation_.emplace(begun + shared_.options.deadline, begun);
  guard_.emplace(shared_.watch, WatchedRequest{connection_.socket(), &*cancellation_,
                                               request.body.size() + incoming_bytes_});
  BodyOnTheWay incoming(connection_, shared_.heavy, *cancellation_, incoming_bytes_);
  if (incoming_bytes_ > 0) request.incoming = &incoming;
  // An unread rest would be taken for the next request, also when the handler throws.
  must_close_ = incoming_bytes_ > 0;
  HttpResponse response = route.handler(request, *cancellation_);
  record_.bytes_in += incoming_bytes_ - incoming.bytes_left();
  must_close_ = incoming.bytes_left() > 0;
  encode_answer(request, response, *cancellation_);
  client_gone_ = incoming.client_gone() || cancellation_->reason() == CancelReason::kDisconnected;
  return response;
}

}  // namespace gridcast::server
