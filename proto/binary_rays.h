#pragma once
// Rays as raw rows: the body of application/vnd.gridcast.rays.

#include <optional>
#include <string_view>

#include "proto/media_type.h"
#include "proto/ray_request.h"

namespace gridcast::proto {

/// Whether what `type` says and how many bytes there are make rays; sets their layout in `request`.
[[nodiscard]] std::optional<Problem> check_binary_rays(const MediaType& type, std::size_t body_bytes,
                                                       const Limits& limits, RayRequest& request);

/// Reads `body` into `request`, whose rows stay where they lie; `type` says how they are laid out (see
/// parse_ray_request). Nothing when it went well.
[[nodiscard]] std::optional<Problem> parse_binary_rays(const MediaType& type, std::string_view body,
                                                       const Limits& limits, RayRequest& request);

}  // namespace gridcast::proto
