#pragma once
// A number that stands for many answers: any bit of any of them changes it.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "core/math/vec.h"

namespace gridcast::digests {

/// FNV-1a of 64 bits ("The FNV Non-Cryptographic Hash Algorithm", G. Fowler, 1991; here of bytes in
/// little-endian order on every machine). Numbers count by their bits: 0 is not -0.
class Digest {
 public:
  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void add(T value) {
    if constexpr (std::is_same_v<T, double>) {
      add_bytes(std::bit_cast<std::uint64_t>(value), sizeof(T));
    } else if constexpr (std::is_same_v<T, float>) {
      add_bytes(std::bit_cast<std::uint32_t>(value), sizeof(T));
    } else {
      add_bytes(std::uint64_t(value), sizeof(T));
    }
  }
  template <class T>
  void add(const glm::vec<3, T>& v) {
    for (int axis = 0; axis < 3; ++axis) add(v[axis]);
  }
  /// How many there are, then each.
  template <class T, class Allocator>
  void add(const std::vector<T, Allocator>& values) {
    add(std::uint64_t(values.size()));
    for (const T& value : values) add(value);
  }

  [[nodiscard]] std::uint64_t value() const { return state_; }

 private:
  void add_bytes(std::uint64_t bytes, std::size_t count) {
    for (; count > 0; --count, bytes >>= 8) state_ = (state_ ^ (bytes & 0xFF)) * 0x100000001B3U;
  }

  std::uint64_t state_ = 0xCBF29CE484222325U;
};

}  // namespace gridcast::digests
