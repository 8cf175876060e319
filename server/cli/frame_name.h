#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace gridcast::server {

/// The name of a numbered picture by a pattern with one place for the number, %d or %0Nd with N of 1 to 9,
/// and
/// %% for a percent sign. Nothing when the pattern is another.
[[nodiscard]] std::optional<std::string> frame_name(const std::string& pattern, std::size_t number);

}  // namespace gridcast::server
