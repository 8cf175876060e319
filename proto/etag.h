#pragma once
// A scene's entity tag is its version: "7" in quotes. Of an answer that is packed it is "7-zstd": a strong
// tag names bytes, and those differ (RFC 9110, 8.8.3.3). Both stand for the version in what clients send
// back.

#include <cstdint>
#include <string>
#include <string_view>

namespace gridcast::proto {

[[nodiscard]] std::string etag(std::uint64_t version);
/// The tag of the same thing packed: "7" -> "7-zstd".
[[nodiscard]] std::string packed_etag(std::string_view tag);
/// Whether a list of tags has one of a packed answer.
[[nodiscard]] bool has_packed_etag(std::string_view header);

enum class TagMatch : std::uint8_t { kMatches, kDiffers, kMalformed };

/// Whether a list of tags or `*`, as in If-Match and If-None-Match, names `version`, packed or not. With
/// kStrong (If-Match) weak tags never match; with kWeak (If-None-Match) W/"7" is the same as "7".
enum class TagComparison : std::uint8_t { kStrong, kWeak };
[[nodiscard]] TagMatch match_etag(std::string_view header, std::uint64_t version, TagComparison comparison);

}  // namespace gridcast::proto
