#pragma once
// Content-Encoding and Accept-Encoding: how bodies are packed on their way (RFC 9110, 8.4 and 12.5.3). zstd
// is the only coding, in both directions.

#include <cstdint>
#include <optional>
#include <string_view>

namespace gridcast::proto {

inline constexpr std::string_view kZstdCoding = "zstd";

enum class BodyCoding : std::uint8_t { kIdentity, kZstd };

/// What a Content-Encoding header says of a body; nothing for codings that are not taken, lists among them.
/// An empty header is kIdentity.
[[nodiscard]] std::optional<BodyCoding> parse_content_encoding(std::string_view header);

/// How an answer may leave.
enum class AnswerCoding : std::uint8_t {
  kIdentity,  ///< as it is
  kZstd,      ///< packed where that pays
  kZstdOnly,  ///< packed; the client refuses it as it is
  kNone,      ///< the client takes neither
};

/// What an Accept-Encoding header allows, and of that what it likes best. An empty header, and one that
/// breaks the grammar, is kIdentity.
[[nodiscard]] AnswerCoding choose_answer_coding(std::string_view accept_encoding);

}  // namespace gridcast::proto
