#pragma once

#include <cstddef>
#include <string_view>

#include "server/http/http_head.h"

namespace gridcast::server {

/// A body of a few hundred rays at most: traced at once, without a place among the heavy work, which takes
/// less than waiting for one.
inline constexpr std::size_t kSmallBodyBytes = std::size_t(8) << 10;
/// Whether what a head asks for is done in no time: a probe, or a question about a few rays. Not
/// when its body is packed: nobody knows yet what is in it.
[[nodiscard]] bool is_small_request(const HttpHead& head);
/// Whether it asks for the work that HeavyLoad counts: many rays, points or pairs.
[[nodiscard]] bool is_heavy_request(const HttpHead& head);
/// Whether it keeps a thread for long, by what it sends or by what it asks for: an upload or a picture.
[[nodiscard]] bool is_long_request(const HttpHead& head);

}  // namespace gridcast::server
