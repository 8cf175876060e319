#pragma once
// The document as parsed JSON, and a cursor that reads it with checks and knows where it is.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/io/gltf.h"

namespace gridcast::io {

using Json = nlohmann::json;

/// A JSON value takes 16 bytes for 2 of text, and two documents exist for a moment: this keeps both below
/// some 2 GiB however the text is made.
inline constexpr std::size_t kMaxJsonValues = 20'000'000;

/// Throws Refusal: not JSON, deeper than the limit, too many values, a key twice in one object, numbers out
/// of the range of double. Parsing is iterative; what follows may recurse, since the depth is bounded.
[[nodiscard]] Json parse_json(std::span<const std::byte> text, const GltfLimits& limits);

/// A value of the document and the way to it. Every reader throws Refusal with the JSON pointer of the
/// offending value. A cursor refers to its parent, which must outlive it.
class Cursor {
 public:
  explicit Cursor(const Json& root) : value_(&root) {}

  [[nodiscard]] const Json& json() const { return *value_; }
  [[nodiscard]] std::string where() const;
  [[noreturn]] void refuse_here(const std::string& message) const;

  [[nodiscard]] bool has(const char* key) const { return value_->contains(key); }
  /// The member, if there is one; this must be an object.
  [[nodiscard]] std::optional<Cursor> find(const char* key) const;
  [[nodiscard]] Cursor require(const char* key) const;
  /// Number of elements; this must be an array.
  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] Cursor element(std::size_t i) const { return {(*value_)[i], this, {}, i}; }
  void expect_object() const;
  void expect_string() const;

  [[nodiscard]] double number() const;
  /// A whole number in [low, high].
  [[nodiscard]] std::int64_t integer(std::int64_t low, std::int64_t high) const;
  [[nodiscard]] std::uint32_t index(std::size_t size) const;
  /// An array of exactly `size` numbers that fit a float.
  void expect_numbers(std::size_t size) const;
  void expect_numbers() const;
  void expect_numbers_in(const char* key, std::size_t size) const;
  /// The member as an index below `size`, or nothing when it is absent.
  [[nodiscard]] std::optional<std::uint32_t> index_in(const char* key, std::size_t size) const;
  [[nodiscard]] std::int64_t integer_or(const char* key, std::int64_t low, std::int64_t high,
                                        std::int64_t otherwise) const;

  /// visit(cursor, i) for each element of the array `key`, none when it is absent; elements are objects.
  template <class Visit>
  void each_object(const char* key, Visit visit) const {
    const auto array = find(key);
    if (!array) return;
    const std::size_t n = array->size();
    for (std::size_t i = 0; i < n; ++i) {
      const Cursor item = array->element(i);
      item.expect_object();
      visit(item, i);
    }
  }

 private:
  Cursor(const Json& value, const Cursor* parent, std::string_view key, std::size_t position)
      : value_(&value), parent_(parent), key_(key), position_(position) {}

  const Json* value_;
  const Cursor* parent_ = nullptr;
  std::string_view key_;  ///< empty: an array element at position_
  std::size_t position_ = 0;
};

}  // namespace gridcast::io
