#include "server/access/token.h"

#include <cerrno>
#include <system_error>

#include <nlohmann/json.hpp>
#include <sys/random.h>

namespace gridcast::server::access {

std::string_view to_string(Role role) {
  switch (role) {
    case Role::kRead:
      return "read";
    case Role::kWrite:
      return "write";
    case Role::kAdmin:
      break;
  }
  return "admin";
}

std::string make_token() {
  store::Digest random{};
  // Up to 256 bytes come whole or not at all.
  if (::getrandom(random.data(), random.size(), 0) != ssize_t(random.size()))
    throw std::system_error(errno, std::generic_category(), "no random bits");
  return "gridcast_" + store::to_hex(random);
}

std::string to_line(const Token& token) {
  nlohmann::ordered_json json{
      {"name", token.name}, {"sha256", store::to_hex(token.sha256)}, {"role", to_string(token.role)}};
  if (token.scenes) json["scenes"] = *token.scenes;
  if (token.requests_per_s) json["requests_per_s"] = *token.requests_per_s;
  if (token.rays_per_s) json["rays_per_s"] = *token.rays_per_s;
  return json.dump();
}

}  // namespace gridcast::server::access
