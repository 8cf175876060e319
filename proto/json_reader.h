#pragma once
// JSON that clients send: bounded, strict, and every complaint with a JSON pointer. A walk reads on after the
// first problem (getters return defaults) and the caller asks once, at the end, whether there was one.

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <simdjson.h>

#include "core/math/vec.h"
#include "proto/parsed.h"

namespace gridcast::proto {

/// The first problem of a walk.
class JsonProblems {
 public:
  void add(ProblemCode code, std::string pointer, std::string detail);
  [[nodiscard]] bool any() const { return first_.has_value(); }
  /// Only after any().
  [[nodiscard]] const Problem& first() const { return *first_; }

 private:
  std::optional<Problem> first_;
};

/// A value and the way to it. Points to its parent, so it must not outlive the reader it came from.
struct JsonNode {
  simdjson::dom::element value;
  JsonProblems* problems = nullptr;
  const JsonNode* parent = nullptr;
  std::string_view key;   ///< in an object
  std::size_t index = 0;  ///< in an array, when `key` has no data
  [[nodiscard]] JsonNode child(simdjson::dom::element element, std::size_t i) const {
    return {element, problems, this, {}, i};
  }
  [[nodiscard]] std::string pointer() const;
  void fail(ProblemCode code, std::string detail) const;
};

/// Owns the text and its parsed form. Problems: payload_too_large, invalid_json, too_deep, the last two with
/// the pointer of the place where the text breaks.
class JsonDocument {
 public:
  static Parsed<JsonDocument> parse(std::string_view text, std::size_t max_bytes, std::size_t max_depth);
  [[nodiscard]] JsonNode root(JsonProblems& problems) const { return {root_, &problems, nullptr, {}, 0}; }

 private:
  std::unique_ptr<simdjson::dom::parser> parser_;
  simdjson::dom::element root_;
};

/// The members of one object. Unknown and repeated members are problems.
class ObjectReader {
 public:
  ObjectReader(const JsonNode& node, std::span<const std::string_view> known);
  ObjectReader(const JsonNode& node, std::initializer_list<std::string_view> known)
      : ObjectReader(node, std::span(known.begin(), known.size())) {}
  ObjectReader(const ObjectReader&) = delete;
  ObjectReader& operator=(const ObjectReader&) = delete;

  /// Null when absent. `name` is a known one.
  [[nodiscard]] const JsonNode* find(std::string_view name) const;
  /// Null when absent, which is a problem (missing_field).
  [[nodiscard]] const JsonNode* require(std::string_view name) const;

 private:
  JsonNode node_;
  std::vector<std::string_view> known_;
  std::vector<std::optional<JsonNode>> found_;
};

/// Nothing when the value is no array (wrong_type).
[[nodiscard]] std::optional<simdjson::dom::array> read_array(const JsonNode& node);
[[nodiscard]] double read_number(const JsonNode& node);
/// `low` < number <= `high`.
[[nodiscard]] double read_number_above(const JsonNode& node, double low, double high);
/// An integer in [low, high]; 3.0 is one too, as in JSON Schema.
[[nodiscard]] std::uint64_t read_integer(const JsonNode& node, std::uint64_t low, std::uint64_t high);
/// Any id but kInvalidId.
[[nodiscard]] std::uint32_t read_id(const JsonNode& node);
[[nodiscard]] bool read_flag(const JsonNode& node);
[[nodiscard]] std::string read_choice(const JsonNode& node, std::span<const std::string_view> names);
/// A name: at most `max_bytes`, no control characters.
[[nodiscard]] std::string read_name(const JsonNode& node, std::size_t max_bytes);
/// An array of exactly three numbers.
[[nodiscard]] Vec3d read_vec3(const JsonNode& node);

/// What read_name asks of a name, for those that come by the query string: also valid UTF-8. Returns what is
/// wrong, or nothing.
[[nodiscard]] std::optional<std::string> complain_about_name(std::string_view name, std::size_t max_bytes);
/// `one of a, b, c`.
[[nodiscard]] std::string list_choices(std::span<const std::string_view> names);

}  // namespace gridcast::proto
