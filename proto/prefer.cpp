#include "proto/prefer.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <string>

#include "proto/header_text.h"

namespace gridcast::proto {
namespace {

// Longer waits are the server's deadline anyway.
constexpr std::uint32_t kMaxWaitSeconds = 86'400;

std::optional<double> read_seconds(std::string_view text) {
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  std::uint32_t seconds = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (parsed.ec != std::errc() || parsed.ptr != text.data() + text.size()) return std::nullopt;
  return double(std::min(seconds, kMaxWaitSeconds));
}

}  // namespace

Preferences parse_prefer(std::string_view header) {
  Preferences preferences;
  while (!header.empty()) {
    const std::size_t comma = std::min(header.find(','), header.size());
    // What follows a ';' are parameters of a preference; those known here have none.
    std::string_view item = header.substr(0, comma);
    item = trimmed(item.substr(0, item.find(';')));
    header.remove_prefix(std::min(comma + 1, header.size()));
    const std::size_t equals = std::min(item.find('='), item.size());
    const std::string name = lower_case(trimmed(item.substr(0, equals)));
    const std::string_view value = trimmed(item.substr(std::min(equals + 1, item.size())));
    if (name == "respond-async") preferences.respond_async = true;
    // Of a preference that is given twice the first one counts.
    if (name == "wait" && !preferences.wait_s) preferences.wait_s = read_seconds(value);
  }
  return preferences;
}

}  // namespace gridcast::proto
