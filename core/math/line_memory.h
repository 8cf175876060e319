#pragma once
// Memory that begins at a cache line.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <new>

namespace gridcast {

inline constexpr std::size_t kCacheLineBytes = 64;

/// At a cache line, until free_lines(). Plain memory with room for a line more, because malloc() hands out
/// again what was freed, while the aligned allocation of glibc 2.36 carves its piece out of a larger one each
/// time.
[[nodiscard]] inline void* allocate_lines(std::size_t bytes) {
  if (bytes > std::numeric_limits<std::size_t>::max() - kCacheLineBytes) throw std::bad_array_new_length();
  auto* const base = static_cast<std::byte*>(::operator new(bytes + kCacheLineBytes));
  static_assert(__STDCPP_DEFAULT_NEW_ALIGNMENT__ >= sizeof base, "room for the pointer in front");
  const auto past_line = std::size_t(reinterpret_cast<std::uintptr_t>(base) % kCacheLineBytes);
  std::byte* const line = base + (kCacheLineBytes - past_line);
  std::memcpy(line - sizeof base, &base, sizeof base);
  return line;
}

inline void free_lines(void* lines) {
  std::byte* base = nullptr;
  std::memcpy(&base, static_cast<std::byte*>(lines) - sizeof base, sizeof base);
  ::operator delete(base);
}

}  // namespace gridcast
