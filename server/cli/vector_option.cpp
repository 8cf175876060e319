#include "server/cli/vector_option.h"

#include <charconv>

namespace gridcast::server {

std::optional<Vec3d> parse_vector(std::string_view text) {
  Vec3d result{0.0};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (int axis = 0; axis < 3; ++axis) {
    if (axis > 0 && (at == end || *at++ != ',')) return std::nullopt;
    const auto parsed = std::from_chars(at, end, result[axis]);
    if (parsed.ec != std::errc()) return std::nullopt;
    at = parsed.ptr;
  }
  if (at != end || !is_finite(result)) return std::nullopt;
  return result;
}

std::optional<std::pair<int, int>> parse_size(std::string_view text) {
  constexpr int kMost = 65536;
  const std::size_t x = text.find('x');
  if (x == text.npos) return std::nullopt;
  std::pair<int, int> size;
  const char* const middle = text.data() + x;
  const char* const end = text.data() + text.size();
  if (std::from_chars(text.data(), middle, size.first).ptr != middle) return std::nullopt;
  if (std::from_chars(middle + 1, end, size.second).ptr != end) return std::nullopt;
  if (size.first < 1 || size.second < 1 || size.first > kMost || size.second > kMost) return std::nullopt;
  return size;
}

}  // namespace gridcast::server
