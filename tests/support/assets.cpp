#include "tests/support/assets.h"

#include <cstdlib>

namespace gridcast::test {
namespace {

std::optional<std::filesystem::path> existing(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored)) return path;
  return std::nullopt;
}

}  // namespace

std::optional<std::filesystem::path> shared_asset(const std::string& relative) {
  const char* root = std::getenv("GRIDCAST_ASSETS");
  if (root != nullptr) return existing(std::filesystem::path(root) / relative);
  return existing(std::filesystem::path(GRIDCAST_SOURCE_DIR) / ".." / "shared" / "assets" / relative);
}

std::optional<std::filesystem::path> assimp_model(const std::string& relative) {
  return existing(std::filesystem::path("/usr/share/assimp/models") / relative);
}

}  // namespace gridcast::test
