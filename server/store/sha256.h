#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace gridcast::server::store {

/// SHA-256 (FIPS 180-4): what a file is named by and checked against. Names must not collide even when a
/// client wants them to, so a checksum that is only fast would not do.
using Digest = std::array<std::uint8_t, 32>;

[[nodiscard]] Digest sha256(std::string_view bytes);
[[nodiscard]] std::string to_hex(const Digest& digest);
/// 64 lower-case digits.
[[nodiscard]] std::optional<Digest> parse_hex(std::string_view text);

}  // namespace gridcast::server::store
