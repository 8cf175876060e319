#pragma once
// Content-Type and Accept: what is in a body and what a client takes back (RFC 9110, 8.3 and 12.5.1).

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace gridcast::proto {

inline constexpr std::string_view kJsonMediaType = "application/json";
inline constexpr std::string_view kRaysMediaType = "application/vnd.gridcast.rays";
inline constexpr std::string_view kPointsMediaType = "application/vnd.gridcast.points";
inline constexpr std::string_view kPairsMediaType = "application/vnd.gridcast.pairs";
inline constexpr std::string_view kHitsMediaType = "application/vnd.gridcast.hits";
inline constexpr std::string_view kVerticesMediaType = "application/vnd.gridcast.vertices";
inline constexpr std::string_view kInstancesMediaType = "application/vnd.gridcast.instances";
inline constexpr std::string_view kGlbMediaType = "model/gltf-binary";
inline constexpr std::string_view kGltfMediaType = "model/gltf+json";
inline constexpr std::string_view kCsvMediaType = "text/csv";
inline constexpr std::string_view kVegaLiteMediaType = "application/vnd.vegalite.v5+json";
inline constexpr std::string_view kSvgMediaType = "image/svg+xml";
inline constexpr std::string_view kPngMediaType = "image/png";
inline constexpr std::string_view kExrMediaType = "image/x-exr";

/// `type/subtype; name=value; ...`, type and names in lower case, quotes removed.
struct MediaType {
  std::string essence;  ///< `application/json`
  std::vector<std::pair<std::string, std::string>> parameters;

  /// Null when there is no such parameter.
  [[nodiscard]] const std::string* find(std::string_view name) const;
};

/// Nothing when the header breaks the grammar or names a parameter twice.
[[nodiscard]] std::optional<MediaType> parse_media_type(std::string_view header);

/// Index into `offered` (media types without parameters, best first) of the one that an Accept header likes
/// best, nothing when it takes none of them. An empty header takes the first.
[[nodiscard]] std::optional<std::size_t> negotiate(std::string_view accept,
                                                   std::span<const std::string_view> offered);

}  // namespace gridcast::proto
