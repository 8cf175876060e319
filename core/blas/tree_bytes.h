#pragma once
// Values and columns of a tree as bytes: little-endian, as they lie in memory, one after the other.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace gridcast::blas {

static_assert(std::endian::native == std::endian::little);

/// Copied as it is. It has no padding, or padding that is zero: what is written depends on the tree alone.
template <class T>
concept Written = std::is_trivially_copyable_v<T>;

class TreeWriter {
 public:
  void reserve(std::size_t bytes) { bytes_.reserve(bytes_.size() + bytes); }

  template <Written T>
  void value(const T& value) {
    raw(&value, sizeof(T));
  }
  void count(std::size_t count) { value(std::uint64_t(count)); }
  /// Its size, and its elements.
  template <class Column>
  void column(const Column& values) {
    static_assert(Written<typename Column::value_type>);
    count(values.size());
    raw(values.data(), values.size() * sizeof(typename Column::value_type));
  }
  [[nodiscard]] std::string take() { return std::move(bytes_); }

 private:
  void raw(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }

  std::string bytes_;
};

/// Reads what a TreeWriter wrote. When the bytes run out it has failed, and everything that it reads is zero
/// or empty.
class TreeReader {
 public:
  explicit TreeReader(std::string_view bytes) : bytes_(bytes) {}

  template <Written T>
  [[nodiscard]] T value() {
    T value{};
    raw(&value, sizeof(T));
    return value;
  }
  /// Of a column whose elements take this many bytes each: more than what is left is wrong, and asks for no
  /// memory.
  [[nodiscard]] std::size_t count(std::size_t element_bytes) {
    const auto count = value<std::uint64_t>();
    failed_ = failed_ || count > bytes_.size() / element_bytes;
    return failed_ ? 0 : std::size_t(count);
  }
  template <class Column>
  void column(Column& values) {
    using T = typename Column::value_type;
    static_assert(Written<T>);
    values.resize(count(sizeof(T)));
    raw(values.data(), values.size() * sizeof(T));
  }
  [[nodiscard]] bool failed() const { return failed_; }
  /// Everything was read, and nothing more is there.
  [[nodiscard]] bool ended() const { return !failed_ && bytes_.empty(); }

 private:
  void raw(void* data, std::size_t size) {
    failed_ = failed_ || size > bytes_.size();
    if (failed_ || size == 0) return;
    std::memcpy(data, bytes_.data(), size);
    bytes_.remove_prefix(size);
  }

  std::string_view bytes_;
  bool failed_ = false;
};

}  // namespace gridcast::blas
