#include "server/cli/frame_name.h"

namespace gridcast::server {
namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

}  // namespace

std::optional<std::string> frame_name(const std::string& pattern, std::size_t number) {
  std::string name;
  std::size_t places = 0;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    if (pattern[i] != '%') {
      name += pattern[i];
      continue;
    }
    if (++i < pattern.size() && pattern[i] == '%') {
      name += '%';
      continue;
    }
    std::size_t width = 0;
    if (i + 1 < pattern.size() && pattern[i] == '0' && is_digit(pattern[i + 1])) {
      width = std::size_t(pattern[i + 1] - '0');
      i += 2;
    }
    if (i >= pattern.size() || pattern[i] != 'd') return std::nullopt;
    const std::string digits = std::to_string(number);
    if (digits.size() < width) name.append(width - digits.size(), '0');
    name += digits;
    ++places;
  }
  if (places != 1) return std::nullopt;
  return name;
}

}  // namespace gridcast::server
