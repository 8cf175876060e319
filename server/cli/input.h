#pragma once

#include <cstddef>
#include <stop_token>
#include <string>

#include "core/error.h"

namespace gridcast::server {

/// The whole of a file, or of standard input for "-", at most `max_bytes`.
[[nodiscard]] Result<std::string> read_input(const std::string& path, std::size_t max_bytes,
                                             const std::stop_token& stop);

}  // namespace gridcast::server
