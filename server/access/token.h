#pragma once
// Tokens: who may do what with which scenes, and how much of it.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/sha256.h"

namespace gridcast::server::access {

/// Each may do what those before it may.
enum class Role : std::uint8_t {
  kRead,   ///< looks at scenes and asks about them
  kWrite,  ///< changes them; creates, copies and deletes them unless it is restricted to some
  kAdmin,  ///< sees and ends the jobs of all tokens
};
[[nodiscard]] std::string_view to_string(Role role);

/// What the tokens file says of one token. The token itself is nowhere but with its owner.
struct Token {
  std::string name;
  store::Digest sha256{};
  Role role = Role::kRead;
  std::optional<std::vector<std::string>> scenes = {};  ///< none: all of them
  std::optional<double> requests_per_s = {};            ///< none: as many as there are
  std::optional<double> rays_per_s = {};
};

/// A new token: a fixed beginning, for those who search code for leaked ones, and 256 random bits of the
/// kernel's in hexadecimal. Throws std::system_error when the kernel gives none.
[[nodiscard]] std::string make_token();

/// The line of a tokens file.
[[nodiscard]] std::string to_line(const Token& token);

}  // namespace gridcast::server::access
