#pragma once
// JSON pointers (RFC 6901) as text, built one step at a time.

#include <cstddef>
#include <string>
#include <string_view>

namespace gridcast::proto {

/// Keys come from clients: a longer one is cut, so that an answer stays small whatever was sent.
inline constexpr std::size_t kMaxPointerKeyBytes = 64;

inline void append_pointer(std::string& pointer, std::string_view key) {
  pointer += '/';
  for (const char c : key.substr(0, kMaxPointerKeyBytes)) {
    if (c == '~')
      pointer += "~0";
    else if (c == '/')
      pointer += "~1";
    else
      pointer += c;
  }
}
inline void append_pointer(std::string& pointer, std::size_t index) {
  pointer += '/';
  pointer += std::to_string(index);
}

}  // namespace gridcast::proto
