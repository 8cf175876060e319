#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace gridcast::proto {

/// Columns of answers about points that may be left out; a set. Every nearest point has its status and
/// distance, every answer of points/inside its places.
enum class PointField : std::uint16_t {
  kNone = 0,
  kPosition = 1U << 0U,
  kUv = 1U << 1U,
  kInstanceId = 1U << 2U,
  kMeshId = 1U << 3U,
  kPrimitiveId = 1U << 4U,
  kSplits = 1U << 5U,  ///< comes with any column by row
  kWinding = 1U << 6U,
  kOnBoundary = 1U << 7U,
  kOpenMeshes = 1U << 8U,
  kAll = (1U << 9U) - 1U,
};
constexpr PointField operator|(PointField a, PointField b) {
  return PointField(std::uint16_t(a) | std::uint16_t(b));
}
constexpr bool wants(PointField fields, PointField any_of) {
  return (std::uint16_t(fields) & std::uint16_t(any_of)) != 0;
}

inline constexpr std::array<std::string_view, 7> kNearestFieldNames{
    "status", "distance", "position", "uv", "instance_id", "mesh_id", "primitive_id"};
inline constexpr std::array<std::string_view, 7> kInsideFieldNames{
    "place", "splits", "instance_id", "mesh_id", "winding", "on_boundary", "open_meshes"};

/// A name of kNearestFieldNames or kInsideFieldNames; nothing for any other. What every answer has adds
/// nothing to a set.
[[nodiscard]] std::optional<PointField> parse_nearest_field(std::string_view name);
[[nodiscard]] std::optional<PointField> parse_inside_field(std::string_view name);

}  // namespace gridcast::proto
