#pragma once
// Values as bytes, little-endian, without padding. A type takes part by a function
//   template <class A> void fields(A& archive, Is<Thing> auto& thing)
// that hands its members, all of them, to the archive: one for both directions.

#include <array>
#include <bit>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/math/affine.h"
#include "core/math/shared_vector.h"
#include "core/math/vec.h"

namespace gridcast::server::store {

static_assert(std::endian::native == std::endian::little);

template <class T, class U>
concept Is = std::same_as<std::remove_const_t<T>, U>;

/// Types without padding and without invalid values: copied as they are.
template <class T>
inline constexpr bool kIsPlain = (std::is_arithmetic_v<T> && !std::same_as<T, bool>) ||
                                 std::same_as<T, Vec3f> || std::same_as<T, Vec3d> || std::same_as<T, Affine>;
template <class T, std::size_t kCount>
inline constexpr bool kIsPlain<std::array<T, kCount>> = kIsPlain<T>;
static_assert(sizeof(Vec3f) == 12 && sizeof(Vec3d) == 24 && sizeof(Affine) == 96);

template <class T>
concept Plain = kIsPlain<T>;

/// How many enumerators an enum has, from 0 on: a larger number is wrong.
template <class T>
inline constexpr int kEnumerators = 0;

class ByteWriter {
 public:
  /// `format` is for `fields` to ask which members there are.
  explicit ByteWriter(std::uint32_t format) : format_(format) {}
  [[nodiscard]] std::uint32_t format() const { return format_; }

  template <class... T>
  void operator()(const T&... values) {
    (item(values), ...);
  }
  [[nodiscard]] std::string take() { return std::move(bytes_); }

 private:
  void raw(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }

  template <class T>
  void item(const T& value) {
    if constexpr (Plain<T>) {
      raw(&value, sizeof(T));
    } else if constexpr (std::same_as<T, bool> || std::is_enum_v<T>) {
      const auto byte = std::uint8_t(value);
      raw(&byte, 1);
    } else {
      fields(*this, value);
    }
  }
  void item(const std::string& text) {
    item(std::uint64_t(text.size()));
    raw(text.data(), text.size());
  }
  template <class T>
  void item(const std::vector<T>& values) {
    item(std::uint64_t(values.size()));
    if constexpr (Plain<T>) {
      raw(values.data(), values.size() * sizeof(T));
    } else {
      for (const T& value : values) item(value);
    }
  }
  template <Plain T>
  void item(const SharedVector<T>& values) {
    item(std::uint64_t(values.size()));
    raw(values.data(), values.size() * sizeof(T));
  }
  template <class T>
  void item(const std::optional<T>& value) {
    item(value.has_value());
    if (value) item(*value);
  }
  template <class T>
  void item(const std::shared_ptr<const T>& value) {
    item(value != nullptr);
    if (value != nullptr) item(*value);
  }
  template <class K, class T>
  void item(const std::map<K, T>& values) {
    item(std::uint64_t(values.size()));
    for (const auto& entry : values) {
      item(entry.first);
      item(entry.second);
    }
  }

  std::uint32_t format_;
  std::string bytes_;
};

/// Reads what a ByteWriter wrote. Bytes that are too few or too many, or values that cannot be, make it fail:
/// then ok() is false, and what was read is not to be used.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}
  /// Once it is known: 0 until then.
  void set_format(std::uint32_t format) { format_ = format; }
  [[nodiscard]] std::uint32_t format() const { return format_; }

  template <class... T>
  void operator()(T&... values) {
    (item(values), ...);
  }
  /// Everything was read, and nothing was wrong.
  [[nodiscard]] bool ok() const { return !failed_ && bytes_.empty(); }

 private:
  bool raw(void* data, std::size_t size) {
    failed_ = failed_ || size > bytes_.size();
    if (failed_ || size == 0) return !failed_;
    std::memcpy(data, bytes_.data(), size);
    bytes_.remove_prefix(size);
    return true;
  }
  /// Each element takes at least a byte: a count beyond what is left is wrong, and asks for no memory.
  std::size_t count(std::size_t element_bytes) {
    std::uint64_t count = 0;
    item(count);
    failed_ = failed_ || count > bytes_.size() / element_bytes;
    return failed_ ? 0 : std::size_t(count);
  }

  template <class T>
  void item(T& value) {
    if constexpr (Plain<T>) {
      raw(&value, sizeof(T));
    } else if constexpr (std::same_as<T, bool>) {
      std::uint8_t byte = 0;
      raw(&byte, 1);
      failed_ = failed_ || byte > 1;
      value = byte == 1;
    } else if constexpr (std::is_enum_v<T>) {
      std::uint8_t byte = 0;
      raw(&byte, 1);
      failed_ = failed_ || byte >= kEnumerators<T>;
      if (!failed_) value = T(byte);
    } else {
      fields(*this, value);
    }
  }
  void item(std::string& text) {
    text.resize(count(1));
    raw(text.data(), text.size());
  }
  template <class T>
  void item(std::vector<T>& values) {
    if constexpr (Plain<T>) {
      values.resize(count(sizeof(T)));
      raw(values.data(), values.size() * sizeof(T));
    } else {
      const std::size_t size = count(1);
      values.clear();
      for (std::size_t i = 0; i < size && !failed_; ++i) item(values.emplace_back());
    }
  }
  template <Plain T>
  void item(SharedVector<T>& values) {
    std::vector<T> read;
    item(read);
    values = std::move(read);
  }
  template <class T>
  void item(std::optional<T>& value) {
    bool there = false;
    item(there);
    if (there) item(value.emplace());
  }
  template <class T>
  void item(std::shared_ptr<const T>& value) {
    bool there = false;
    item(there);
    if (!there) return value.reset();
    auto read = std::make_shared<T>();
    item(*read);
    value = std::move(read);
  }
  /// Keys ascend, as they were written.
  template <class K, class T>
  void item(std::map<K, T>& values) {
    const std::size_t size = count(1);
    values.clear();
    for (std::size_t i = 0; i < size && !failed_; ++i) {
      K key{};
      item(key);
      failed_ = failed_ || (!values.empty() && !(values.rbegin()->first < key));
      item(values[key]);
    }
  }

  std::string_view bytes_;
  std::uint32_t format_ = 0;
  bool failed_ = false;
};

}  // namespace gridcast::server::store
