#include "server/http/http_head.h"

#include <algorithm>
#include <array>
#include <cctype>

#include "proto/header_text.h"

namespace gridcast::server {
namespace {

using proto::lower_case;
using proto::ProblemCode;
using proto::trimmed;

bool is_token_character(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
         std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
}
bool is_token(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), is_token_character);
}
bool is_visible(char c) {
  return c > 0x20 && c < 0x7f;
}
// Field values may hold spaces, tabs and bytes above ASCII, never controls.
bool is_field_character(char c) {
  return c == '\t' || (static_cast<unsigned char>(c) >= 0x20 && c != 0x7f);
}

std::optional<HeadError> read_request_line(std::string_view line, HttpHead& head) {
  const std::size_t first = line.find(' ');
  const std::size_t second = first == line.npos ? first : line.find(' ', first + 1);
  if (second == line.npos) return HeadError{ProblemCode::kInvalidRequest, "malformed request line"};
  const std::string_view method = line.substr(0, first);
  const std::string_view target = line.substr(first + 1, second - first - 1);
  const std::string_view version = line.substr(second + 1);
  if (!is_token(method)) return HeadError{ProblemCode::kInvalidRequest, "malformed method"};
  constexpr std::array<std::string_view, 7> kMethods{"GET",   "HEAD",   "POST",   "PUT",
                                                     "PATCH", "DELETE", "OPTIONS"};
  if (std::find(kMethods.begin(), kMethods.end(), method) == kMethods.end())
    return HeadError{ProblemCode::kMethodNotAllowed, "this method is not implemented"};
  if (target.size() > kMaxTargetBytes)
    return HeadError{ProblemCode::kUriTooLong, "the request target is too long"};
  if (target.empty() || target[0] != '/' || target.find('#') != target.npos ||
      !std::all_of(target.begin(), target.end(), is_visible))
    return HeadError{ProblemCode::kInvalidRequest,
                     "the request target must be an absolute path in visible ASCII"};
  if (version != "HTTP/1.1" && version != "HTTP/1.0")
    return HeadError{ProblemCode::kInvalidRequest,
                     "only versions 1.0 and 1.1 of the protocol are spoken here"};
  head.method = method;
  head.target = target;
  head.minor_version = version.back() - '0';
  return std::nullopt;
}

std::optional<HeadError> read_field(std::string_view line, HttpHead& head) {
  // A line that starts with a space would continue the one before it (obsolete folding): refused.
  const std::size_t colon = line.find(':');
  if (colon == line.npos || !is_token(line.substr(0, colon)))
    return HeadError{ProblemCode::kInvalidRequest, "malformed header field name"};
  const std::string_view value = trimmed(line.substr(colon + 1));
  if (!std::all_of(value.begin(), value.end(), is_field_character))
    return HeadError{ProblemCode::kInvalidRequest, "control character in a header field"};
  if (head.headers.size() == kMaxHeaders)
    return HeadError{ProblemCode::kHeadersTooLarge, "too many header fields"};
  head.headers.emplace_back(lower_case(line.substr(0, colon)), std::string(value));
  return std::nullopt;
}

std::size_t count(const HttpHead& head, std::string_view name) {
  return std::size_t(std::count_if(head.headers.begin(), head.headers.end(),
                                   [&](const auto& field) { return field.first == name; }));
}

std::optional<HeadError> read_framing(HttpHead& head) {
  const std::size_t lengths = count(head, "content-length");
  const std::size_t codings = count(head, "transfer-encoding");
  if (lengths > 1 || codings > 1 || (lengths != 0 && codings != 0))
    return HeadError{ProblemCode::kInvalidRequest, "more than one statement of the body's length"};
  if (codings == 1) {
    if (head.minor_version == 0)
      return HeadError{ProblemCode::kInvalidRequest, "Transfer-Encoding in HTTP/1.0"};
    if (lower_case(*head.find("transfer-encoding")) != "chunked")
      return HeadError{ProblemCode::kLengthRequired, "the only transfer coding known here is chunked"};
    head.framing = BodyFraming::kChunked;
  }
  if (lengths == 1) {
    const std::string text = *head.find("content-length");
    // 18 digits stay below 2^63.
    const bool digits = !text.empty() && text.size() <= 18 &&
                        std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (!digits) return HeadError{ProblemCode::kInvalidRequest, "malformed Content-Length"};
    head.content_length = std::stoull(text);
    head.framing = BodyFraming::kLength;
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> HttpHead::find(std::string_view lower_case_name) const {
  for (const auto& [name, value] : headers)
    if (name == lower_case_name) return value;
  return std::nullopt;
}

bool HttpHead::wants_close() const {
  const std::string connection = lower_case(find("connection").value_or(""));
  return minor_version == 0 ? connection != "keep-alive" : connection.find("close") != std::string::npos;
}

std::variant<HttpHead, HeadError> parse_head(std::string_view text) {
  HttpHead head;
  bool first = true;
  while (true) {
    const std::size_t end = text.find("\r\n");
    if (end == text.npos)
      return HeadError{ProblemCode::kInvalidRequest, "the head does not end with an empty line"};
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 2);
    if (line.find_first_of(std::string_view("\r\n\0", 3)) != line.npos)
      return HeadError{ProblemCode::kInvalidRequest, "bare CR, LF or NUL in the head"};
    if (line.empty() && !first) break;
    const std::optional<HeadError> error = first ? read_request_line(line, head) : read_field(line, head);
    if (error) return *error;
    first = false;
  }
  if (!text.empty()) return HeadError{ProblemCode::kInvalidRequest, "bytes after the head"};
  const std::size_t hosts = count(head, "host");
  if (hosts > 1 || (hosts == 0 && head.minor_version == 1))
    return HeadError{ProblemCode::kInvalidRequest, "exactly one Host field is required"};
  if (const std::optional<HeadError> error = read_framing(head)) return *error;
  return head;
}

}  // namespace gridcast::server
