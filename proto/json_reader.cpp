#include "proto/json_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "proto/json_break.h"
#include "proto/json_pointer.h"

namespace gridcast::proto {

void JsonProblems::add(ProblemCode code, std::string pointer, std::string detail) {
  if (!first_) first_ = Problem{code, std::move(detail), std::move(pointer)};
}

std::string JsonNode::pointer() const {
  if (parent == nullptr) return {};
  std::string text = parent->pointer();
  if (key.data() != nullptr)
    append_pointer(text, key);
  else
    append_pointer(text, index);
  return text;
}

void JsonNode::fail(ProblemCode code, std::string detail) const {
  if (!problems->any()) problems->add(code, pointer(), std::move(detail));
}

Parsed<JsonDocument> JsonDocument::parse(std::string_view text, std::size_t max_bytes,
                                         std::size_t max_depth) {
  if (text.size() > max_bytes)
    return Problem{ProblemCode::kPayloadTooLarge,
                   "a JSON body may have at most " + std::to_string(max_bytes) + " bytes", ""};
  // A parser per request: its buffers are 13 times the text, too much to keep for every thread.
  JsonDocument document;
  document.parser_ = std::make_unique<simdjson::dom::parser>();
  const std::size_t capacity = std::max<std::size_t>(text.size(), 64);
  if (document.parser_->allocate(capacity, max_depth) != simdjson::SUCCESS)
    return Problem{ProblemCode::kInternal, "no memory to parse the body", ""};
  const auto error = document.parser_->parse(text.data(), text.size()).get(document.root_);
  if (error == simdjson::MEMALLOC) return Problem{ProblemCode::kInternal, "no memory to parse the body", ""};
  if (error != simdjson::SUCCESS) return find_json_break(text, max_depth);
  return document;
}

ObjectReader::ObjectReader(const JsonNode& node, std::span<const std::string_view> known)
    : node_(node), known_(known.begin(), known.end()), found_(known.size()) {
  simdjson::dom::object object;
  if (node.value.get(object) != simdjson::SUCCESS) {
    node.fail(ProblemCode::kWrongType, "must be an object");
    return;
  }
  for (const auto field : object) {
    const JsonNode member{field.value, node.problems, &node_, field.key, 0};
    const auto it = std::find(known_.begin(), known_.end(), field.key);
    if (it == known_.end()) {
      member.fail(ProblemCode::kUnknownField, "is not a member known here");
      return;
    }
    auto& slot = found_[std::size_t(it - known_.begin())];
    if (slot) {
      member.fail(ProblemCode::kDuplicateField, "is given more than once");
      return;
    }
    slot = member;
  }
}

const JsonNode* ObjectReader::find(std::string_view name) const {
  const auto it = std::find(known_.begin(), known_.end(), name);
  const auto& slot = found_.at(std::size_t(it - known_.begin()));  // a name that is not known is our mistake
  return slot ? &*slot : nullptr;
}

const JsonNode* ObjectReader::require(std::string_view name) const {
  const JsonNode* member = find(name);
  if (member == nullptr)
    JsonNode{{}, node_.problems, &node_, name, 0}.fail(ProblemCode::kMissingField, "is required");
  return member;
}

std::optional<simdjson::dom::array> read_array(const JsonNode& node) {
  simdjson::dom::array array;
  if (node.value.get(array) == simdjson::SUCCESS) return array;
  node.fail(ProblemCode::kWrongType, "must be an array");
  return std::nullopt;
}

double read_number(const JsonNode& node) {
  double number = 0.0;
  if (node.value.get(number) != simdjson::SUCCESS) node.fail(ProblemCode::kWrongType, "must be a number");
  return number;
}

double read_number_above(const JsonNode& node, double low, double high) {
  const double number = read_number(node);
  if (!(number > low && number <= high)) {
    node.fail(ProblemCode::kOutOfRange,
              "must be above " + std::to_string(low) + " and at most " + std::to_string(high));
  }
  return number;
}

std::uint64_t read_integer(const JsonNode& node, std::uint64_t low, std::uint64_t high) {
  std::uint64_t integer = 0;
  bool in_range = false;
  if (node.value.get(integer) == simdjson::SUCCESS) {
    in_range = integer >= low && integer <= high;
  } else {
    double number = 0.0;
    if (node.value.get(number) != simdjson::SUCCESS || number != std::floor(number)) {
      node.fail(ProblemCode::kWrongType, "must be an integer");
      return low;
    }
    in_range = number >= double(low) && number <= double(high) && number < 0x1p63;
    if (in_range) integer = std::uint64_t(number);
  }
  if (in_range) return integer;
  node.fail(ProblemCode::kOutOfRange,
            "must be an integer from " + std::to_string(low) + " to " + std::to_string(high));
  return low;
}

std::uint32_t read_id(const JsonNode& node) {
  return std::uint32_t(read_integer(node, 0, kInvalidId - 1));
}

bool read_flag(const JsonNode& node) {
  bool flag = false;
  if (node.value.get(flag) != simdjson::SUCCESS) node.fail(ProblemCode::kWrongType, "must be true or false");
  return flag;
}

std::string list_choices(std::span<const std::string_view> names) {
  std::string text = "must be one of";
  for (const std::string_view name : names) {
    text += name == names.front() ? " " : ", ";
    text += name;
  }
  return text;
}

namespace {
/// A view into the document, empty after a problem.
std::string_view read_string(const JsonNode& node) {
  std::string_view text;
  if (node.value.get(text) != simdjson::SUCCESS) node.fail(ProblemCode::kWrongType, "must be a string");
  return text;
}
}  // namespace

std::string read_choice(const JsonNode& node, std::span<const std::string_view> names) {
  const std::string_view text = read_string(node);
  if (std::find(names.begin(), names.end(), text) != names.end()) return std::string(text);
  node.fail(ProblemCode::kInvalidValue, list_choices(names));
  return std::string(names.front());
}

std::optional<std::string> complain_about_name(std::string_view name, std::size_t max_bytes) {
  if (name.size() > max_bytes) return "must have at most " + std::to_string(max_bytes) + " bytes";
  // Names end up in logs and headers of tools: no line breaks, no escapes for terminals.
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; };
  if (std::any_of(name.begin(), name.end(), is_control)) return "must not hold control characters";
  if (!simdjson::validate_utf8(name)) return "must be UTF-8";
  return std::nullopt;
}

std::string read_name(const JsonNode& node, std::size_t max_bytes) {
  const std::string_view text = read_string(node);
  if (auto complaint = complain_about_name(text, max_bytes)) {
    node.fail(ProblemCode::kInvalidValue, std::move(*complaint));
    return {};
  }
  return std::string(text);
}

Vec3d read_vec3(const JsonNode& node) {
  Vec3d vector{0.0};
  const auto array = read_array(node);
  if (!array) return vector;
  int count = 0;
  for (const simdjson::dom::element element : *array) {
    if (count < 3 && element.get(vector[count]) != simdjson::SUCCESS) {
      node.child(element, std::size_t(count)).fail(ProblemCode::kWrongType, "must be a number");
      return vector;
    }
    if (++count > 3) break;
  }
  if (count != 3) node.fail(ProblemCode::kWrongLength, "must have exactly 3 numbers");
  return vector;
}

}  // namespace gridcast::proto
