#pragma once
// What the writers of column answers share: JSON text and binary columns behind a head.

#include <charconv>
#include <cmath>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/hit_reply.h"

namespace gridcast::proto {

/// Grows one string by characters; numbers are written in place, as the shortest text with the same bits.
class JsonText {
 public:
  explicit JsonText(std::size_t expected_bytes) { text_.reserve(expected_bytes); }

  void raw(std::string_view text) { text_.append(text); }
  template <class T>
  void number(T value) {
    constexpr std::size_t kLongest = 32;  // "-2.2250738585072014e-308" has 24
    char buffer[kLongest];
    char* end = std::to_chars(buffer, buffer + kLongest, value).ptr;
    const std::string_view digits(buffer, std::size_t(end - buffer));
    text_.append(digits);
    // Digits alone are an integer to most readers: "-0" would lose its sign, and one of more than 64 bits is
    // refused by some.
    if constexpr (std::is_floating_point_v<T>) {
      const bool is_negative_zero = value == T(0) && std::signbit(value);
      const bool is_long = std::abs(value) > T(1ULL << 53U) && digits.find('e') == digits.npos;
      if (is_negative_zero || is_long) text_.append(".0");
    }
  }
  /// As the shortest text that gives these bits to whoever reads it as a double first, too: few floats need
  /// more digits for that (7.038531e-26 would be rounded twice, to its neighbour).
  void narrowed(float value);
  [[nodiscard]] std::size_t size() const { return text_.size(); }
  [[nodiscard]] std::string take() && { return std::move(text_); }

 private:
  std::string text_;
};

/// `{"scene_version":"7"`
void write_version(JsonText& text, const ReplyHead& head);
/// `{"scene_version":"7","status":[...]`
void write_start(JsonText& text, const ReplyHead& head, std::span<const RayStatus> status);
void write_end(JsonText& text, const ReplyHead& head);

/// `,"name":[v,v,...]`, `count` values each written by `write(i)`.
template <class Write>
void write_list(JsonText& text, std::string_view name, std::size_t count, Write write) {
  text.raw(",\"");
  text.raw(name);
  text.raw("\":[");
  for (std::size_t i = 0; i < count; ++i) {
    if (i != 0) text.raw(",");
    write(i);
  }
  text.raw("]");
}

/// A number, or `width` of them in brackets.
template <class Values>
void write_row(JsonText& text, const Values& values, std::size_t i, std::size_t width) {
  if (width == 1) return text.number(values[i]);
  for (std::size_t c = 0; c < width; ++c) {
    text.raw(c == 0 ? "[" : ",");
    text.number(values[width * i + c]);
  }
  text.raw("]");
}

/// `,"name":[v,v,...]`, all there are.
template <class Values>
void write_all(JsonText& text, std::string_view name, const Values& values, std::size_t width = 1) {
  write_list(text, name, values.size() / width, [&](std::size_t i) { write_row(text, values, i, width); });
}

/// An infinite bound, which JSON has no number for, is null.
inline void write_bound(JsonText& text, double value) {
  if (std::isfinite(value)) return text.number(value);
  text.raw("null");
}

/// A miss and an invalid ray have no hit to tell of.
inline bool has_hit(RayStatus status) {
  return status != RayStatus::kMiss && status != RayStatus::kInvalid;
}

/// `,"name":[v,v,null,...]`: one entry per status, null without a hit.
template <class Write>
void write_column(JsonText& text, std::string_view name, const std::vector<RayStatus>& status, Write write) {
  write_list(text, name, status.size(), [&](std::size_t i) {
    if (!has_hit(status[i])) return text.raw("null");
    write(i);
  });
}
template <class Values>
void write_values(JsonText& text, std::string_view name, const std::vector<RayStatus>& status,
                  const Values& values, std::size_t width) {
  write_column(text, name, status, [&](std::size_t i) { write_row(text, values, i, width); });
}

/// Collects columns, each starting at a multiple of kAlignment, and describes them for the head.
class ColumnTable {
 public:
  void add(std::string_view name, std::string_view dtype, std::span<const std::byte> values, std::size_t rows,
           std::size_t width);
  /// A column that names its type and the number of its rows itself.
  template <class Values>
  void add(std::string_view name, const Values& values, std::size_t width = 1) {
    add(name, dtype_of<typename Values::value_type>(), std::as_bytes(std::span(values)),
        values.size() / width, width);
  }

  BinaryBody finish(const ReplyHead& head) &&;

 private:
  template <class T>
  static constexpr std::string_view dtype_of() {
    if constexpr (std::is_same_v<T, double>) return "F64";
    if constexpr (std::is_same_v<T, float>) return "F32";
    if constexpr (std::is_same_v<T, std::uint64_t>) return "U64";
    if constexpr (std::is_same_v<T, std::uint32_t>) return "U32";
    if constexpr (std::is_same_v<T, std::int32_t>) return "I32";
    static_assert(sizeof(T) != 1 || std::is_same_v<T, std::uint8_t> || std::is_enum_v<T>);
    if constexpr (sizeof(T) == 1) return "U8";
  }
  nlohmann::ordered_json head_ = nlohmann::ordered_json::object();
  BinaryBody body_;
  std::size_t end_ = 0;
};

/// The columns of hits that a reply is asked for, but for `status`: see write_hits_json and
/// write_hits_binary.
void write_hit_columns(JsonText& text, const HitColumns& hits, HitField fields);
void add_hit_columns(ColumnTable& table, const HitColumns& hits, HitField fields);

}  // namespace gridcast::proto
