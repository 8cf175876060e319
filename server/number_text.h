#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace gridcast::server {

/// 1234567 -> "1,234,567".
[[nodiscard]] std::string grouped(std::uint64_t number);
/// 1536 -> "1.5 KiB".
[[nodiscard]] std::string bytes_text(std::size_t bytes);

}  // namespace gridcast::server
