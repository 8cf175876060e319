#pragma once

#include <optional>
#include <string_view>
#include <utility>

#include "core/math/vec.h"

namespace gridcast::server {

/// "1,2.5,-3": three finite numbers.
[[nodiscard]] std::optional<Vec3d> parse_vector(std::string_view text);

/// "1024x768": two counts from 1 to 65536.
[[nodiscard]] std::optional<std::pair<int, int>> parse_size(std::string_view text);

}  // namespace gridcast::server
