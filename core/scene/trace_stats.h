#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace gridcast::scene {

/// In which order a batch was traced; answers come in the caller's order whatever it is.
enum class RayOrderKind : std::uint8_t { kAsGiven, kByOrigin, kByDirection };
[[nodiscard]] std::string_view to_string(RayOrderKind kind);  ///< as_given, by_origin, by_direction

/// What a batch call decided. No answer depends on it.
struct TraceStats {
  RayOrderKind order = RayOrderKind::kAsGiven;
  std::string reason;             ///< why this order, as a sentence
  std::uint64_t packet_rays = 0;  ///< up to sixteen at a time, in one instance at least
  std::uint64_t single_rays = 0;  ///< the others, one by one; invalid rays count in neither
  double order_ms = 0.0;          ///< looking and sorting
};

}  // namespace gridcast::scene
