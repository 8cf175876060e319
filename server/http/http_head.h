#pragma once
// A strict reader of HTTP/1.1 request heads. What is ambiguous between parsers is refused, so that nothing
// behind or before us can see other requests than we do.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "proto/error_table.h"

namespace gridcast::server {

inline constexpr std::size_t kMaxHeadBytes = std::size_t(16) << 10;
inline constexpr std::size_t kMaxHeaders = 100;
inline constexpr std::size_t kMaxTargetBytes = 4096;

enum class BodyFraming : std::uint8_t { kNone, kLength, kChunked };

struct HttpHead {
  std::string method;
  std::string target;  ///< origin form, visible ASCII
  int minor_version = 1;
  std::vector<std::pair<std::string, std::string>> headers;  ///< names in lower case
  BodyFraming framing = BodyFraming::kNone;
  std::uint64_t content_length = 0;  ///< of kLength

  [[nodiscard]] std::optional<std::string> find(std::string_view lower_case_name) const;
  /// Whether the client wants the connection closed after the answer.
  [[nodiscard]] bool wants_close() const;
};

struct HeadError {
  proto::ProblemCode code = proto::ProblemCode::kInvalidRequest;
  std::string detail;
};

/// `text` is everything up to and including the empty line.
[[nodiscard]] std::variant<HttpHead, HeadError> parse_head(std::string_view text);

}  // namespace gridcast::server
