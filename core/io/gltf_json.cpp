#include "core/io/gltf_json.h"

#include <cmath>
#include <limits>

#include "core/io/gltf_refusal.h"

namespace gridcast::io {
namespace {

/// Builds the document from parser events, refusing as early as possible. Unlike the library's own builder it
/// bounds depth and size and does not let the last of two equal keys win.
class DocumentBuilder {
 public:
  explicit DocumentBuilder(std::size_t max_depth) : max_depth_(max_depth) {}

  bool null() { return add(nullptr); }
  bool boolean(bool value) { return add(value); }
  bool number_integer(Json::number_integer_t value) { return add(value); }
  bool number_unsigned(Json::number_unsigned_t value) { return add(value); }
  bool number_float(Json::number_float_t value, const std::string& /*text*/) { return add(value); }
  bool string(std::string& value) { return add(std::move(value)); }
  bool binary(Json::binary_t& /*value*/) { return false; }
  bool start_object(std::size_t /*size*/) { return open(Json::object()); }
  bool start_array(std::size_t /*size*/) { return open(Json::array()); }
  bool end_object() { return close(); }
  bool end_array() { return close(); }

  bool key(std::string& name) {
    const auto [place, added] = open_.back()->get_ref<Json::object_t&>().try_emplace(name);
    if (!added) return fail("a key appears twice in one object: '" + name.substr(0, 64) + "'");
    slot_ = &place->second;
    return true;
  }
  bool parse_error(std::size_t position, const std::string& /*token*/, const Json::exception& /*why*/) {
    return fail("not valid JSON, or a number out of range, near byte " + std::to_string(position));
  }

  [[nodiscard]] const std::string& problem() const { return problem_; }
  [[nodiscard]] Json take() { return std::move(root_); }

 private:
  bool fail(std::string problem) {
    if (problem_.empty()) problem_ = std::move(problem);
    return false;
  }
  bool add(Json value) { return place(std::move(value)) != nullptr; }
  bool open(Json value) {
    if (open_.size() >= max_depth_) return fail("JSON nested too deep");
    Json* placed = place(std::move(value));
    if (placed == nullptr) return false;
    open_.push_back(placed);
    return true;
  }
  bool close() {
    open_.pop_back();
    return true;
  }
  Json* place(Json value) {
    if (++values_ > kMaxJsonValues) {
      fail("the JSON has too many values");
      return nullptr;
    }
    if (open_.empty()) return &(root_ = std::move(value));
    if (open_.back()->is_array())
      return &open_.back()->get_ref<Json::array_t&>().emplace_back(std::move(value));
    return &(*slot_ = std::move(value));
  }

  std::size_t max_depth_;
  std::size_t values_ = 0;
  Json root_;
  std::vector<Json*> open_;  ///< the open containers; an element of an array moves only after it is closed
  Json* slot_ = nullptr;     ///< where the value of the last key goes
  std::string problem_;
};

}  // namespace

Json parse_json(std::span<const std::byte> text, const GltfLimits& limits) {
  if (text.size() > limits.json_bytes) refuse(ErrorCode::kLimitExceeded, "the JSON is longer than the limit");
  const auto* first = reinterpret_cast<const char*>(text.data());
  // The parser would skip a byte order mark; glTF forbids it.
  if (text.size() >= 3 && std::string_view(first, 3) == "\xEF\xBB\xBF")
    refuse_invalid("the JSON starts with a byte order mark");
  DocumentBuilder builder(limits.json_depth);
  const bool whole = Json::sax_parse(first, first + text.size(), &builder);
  if (!whole) refuse_invalid(builder.problem());
  return builder.take();
}

std::string Cursor::where() const {
  if (parent_ == nullptr) return {};
  return parent_->where() + "/" + (key_.empty() ? std::to_string(position_) : std::string(key_));
}

void Cursor::refuse_here(const std::string& message) const {
  refuse_invalid(message, where());
}

std::optional<Cursor> Cursor::find(const char* key) const {
  expect_object();
  const auto found = value_->find(key);
  if (found == value_->end()) return std::nullopt;
  return Cursor(*found, this, key, 0);
}

Cursor Cursor::require(const char* key) const {
  const auto found = find(key);
  if (!found) refuse_here(std::string("the required property '") + key + "' is missing");
  return *found;
}

std::size_t Cursor::size() const {
  if (!value_->is_array()) refuse_here("must be an array");
  return value_->size();
}

void Cursor::expect_object() const {
  if (!value_->is_object()) refuse_here("must be an object");
}

void Cursor::expect_string() const {
  if (!value_->is_string()) refuse_here("must be a string");
}

double Cursor::number() const {
  if (!value_->is_number()) refuse_here("must be a number");
  const double value = value_->get<double>();
  if (!(std::abs(value) <= double(std::numeric_limits<float>::max()))) refuse_here("does not fit a float");
  return value;
}

std::int64_t Cursor::integer(std::int64_t low, std::int64_t high) const {
  if (!value_->is_number_integer()) refuse_here("must be a whole number");
  const bool huge = value_->is_number_unsigned() &&
                    value_->get<std::uint64_t>() > std::uint64_t(std::numeric_limits<std::int64_t>::max());
  const std::int64_t value = huge ? std::numeric_limits<std::int64_t>::max() : value_->get<std::int64_t>();
  if (value < low || value > high)
    refuse_here("is out of range: must lie in [" + std::to_string(low) + ", " + std::to_string(high) + "]");
  return value;
}

std::uint32_t Cursor::index(std::size_t size) const {
  if (!value_->is_number_integer()) refuse_here("must be an index");
  if (!value_->is_number_unsigned() || value_->get<std::uint64_t>() >= size)
    refuse_here("refers to an element that does not exist (there are " + std::to_string(size) + ")");
  return value_->get<std::uint32_t>();
}

void Cursor::expect_numbers() const {
  const std::size_t n = size();
  for (std::size_t i = 0; i < n; ++i) (void)element(i).number();
}

void Cursor::expect_numbers(std::size_t wanted) const {
  if (size() != wanted) refuse_here("must have " + std::to_string(wanted) + " numbers");
  expect_numbers();
}

void Cursor::expect_numbers_in(const char* key, std::size_t size) const {
  if (const auto member = find(key)) member->expect_numbers(size);
}

std::optional<std::uint32_t> Cursor::index_in(const char* key, std::size_t size) const {
  const auto member = find(key);
  if (!member) return std::nullopt;
  return member->index(size);
}

std::int64_t Cursor::integer_or(const char* key, std::int64_t low, std::int64_t high,
                                std::int64_t otherwise) const {
  const auto member = find(key);
  return member ? member->integer(low, high) : otherwise;
}

}  // namespace gridcast::io
