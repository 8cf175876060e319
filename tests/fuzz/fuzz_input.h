#pragma once
// Values out of a fuzzer's bytes, and how a target says that something is wrong.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <span>
#include <string_view>

#include "core/math/affine.h"
#include "core/math/vec.h"

/// Called by libFuzzer, whose name it is, or by replay.cpp where that is not there.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace gridcast::fuzz {

/// Ends the program, which is how a fuzzer learns of a failure.
inline void require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "fuzz: %s\n", what);
  std::abort();
}

/// Reads from the front. Zeros when the bytes run out.
class FuzzInput {
 public:
  FuzzInput(const std::uint8_t* data, std::size_t size) : bytes_(data, size) {}

  [[nodiscard]] bool empty() const { return bytes_.empty(); }

  std::uint8_t byte() {
    if (bytes_.empty()) return 0;
    const std::uint8_t first = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return first;
  }
  /// `n` in [1, 256].
  std::uint32_t below(std::uint32_t n) { return byte() % n; }

  /// Everything that is left.
  [[nodiscard]] std::string_view text() const {
    return {reinterpret_cast<const char*>(bytes_.data()), bytes_.size()};
  }
  [[nodiscard]] std::span<const std::byte> rest() const { return std::as_bytes(bytes_); }

  template <class T>
  T raw() {
    T value{};
    const std::size_t size = std::min(sizeof value, bytes_.size());
    if (size != 0) std::memcpy(&value, bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
    return value;
  }

  /// Mostly small multiples of 1/4, which meet each other exactly, at times any float.
  float coordinate() {
    const std::uint8_t kind = byte();
    if (kind < 224) return float(int(kind) - 112) * 0.25F;
    return raw<float>();
  }
  double number() {
    const std::uint8_t kind = byte();
    if (kind < 224) return double(int(kind) - 112) * 0.25;
    return kind < 240 ? double(raw<float>()) : raw<double>();
  }
  Vec3f point() {
    const float x = coordinate(), y = coordinate(), z = coordinate();
    return {x, y, z};
  }
  Vec3d vector() {
    const double x = number(), y = number(), z = number();
    return {x, y, z};
  }
  /// The identity, a mirrored or scaled one, or any nine numbers; and a translation.
  Affine affine() {
    Affine affine;
    switch (below(4)) {
      case 0:
        break;
      case 1:
        affine.linear[0] = -affine.linear[0];
        break;
      case 2:
        affine.linear *= number();
        break;
      default:
        for (int column = 0; column < 3; ++column) affine.linear[column] = vector();
        break;
    }
    affine.translation = vector();
    return affine;
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

/// Whether every number of a transform is one.
inline bool is_finite(const Affine& affine) {
  bool finite = true;
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) finite = finite && std::isfinite(affine.linear[c][r]);
  for (int r = 0; r < 3; ++r) finite = finite && std::isfinite(affine.translation[r]);
  return finite;
}

}  // namespace gridcast::fuzz
