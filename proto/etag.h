#pragma once
// A scene's entity tag is its version: "7" in quotes.

#include <cstdint>
#include <string>
#include <string_view>

namespace gridcast::proto {

[[nodiscard]] std::string etag(std::uint64_t version);

enum class TagMatch : std::uint8_t { kMatches, kDiffers, kMalformed };

/// Whether a list of tags or `*`, as in If-Match and If-None-Match, names `version`. With kStrong (If-Match)
/// weak tags never match; with kWeak (If-None-Match) W/"7" is the same as "7".
enum class TagComparison : std::uint8_t { kStrong, kWeak };
[[nodiscard]] TagMatch match_etag(std::string_view header, std::uint64_t version, TagComparison comparison);

}  // namespace gridcast::proto
