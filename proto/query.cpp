#include "proto/query.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "proto/json_pointer.h"
#include "proto/json_reader.h"

namespace gridcast::proto {

QueryReader::QueryReader(const QueryParameters& parameters, std::span<const std::string_view> known)
    : parameters_(parameters) {
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const std::string& name = parameters[i].first;
    if (std::find(known.begin(), known.end(), name) == known.end())
      fail(ProblemCode::kUnknownParameter, name, "is not a parameter known here");
    for (std::size_t k = 0; k < i && !problem_; ++k)
      if (parameters[k].first == name) fail(ProblemCode::kInvalidValue, name, "is given more than once");
    if (problem_) return;
  }
}

void QueryReader::fail(ProblemCode code, std::string_view name, std::string detail) {
  if (problem_) return;
  std::string pointer(1, '?');
  pointer += name.substr(0, kMaxPointerKeyBytes);
  problem_ = Problem{code, std::move(detail), std::move(pointer)};
}

const std::string* QueryReader::find(std::string_view name) const {
  for (const auto& [key, value] : parameters_)
    if (key == name) return &value;
  return nullptr;
}

std::string QueryReader::choice(std::string_view name, std::span<const std::string_view> names,
                                std::string_view fallback) {
  const std::string* text = find(name);
  if (text == nullptr) return std::string(fallback);
  if (std::find(names.begin(), names.end(), *text) != names.end()) return *text;
  fail(ProblemCode::kInvalidValue, name, list_choices(names));
  return std::string(fallback);
}

std::uint64_t QueryReader::integer(std::string_view name, std::uint64_t low, std::uint64_t high,
                                   std::uint64_t fallback) {
  const std::string* text = find(name);
  if (text == nullptr) return fallback;
  std::uint64_t value = 0;
  const char* end = text->data() + text->size();
  const auto [stop, error] = std::from_chars(text->data(), end, value);
  if (error == std::errc() && stop == end && value >= low && value <= high) return value;
  fail(ProblemCode::kOutOfRange, name,
       "must be an integer from " + std::to_string(low) + " to " + std::to_string(high));
  return fallback;
}

std::optional<double> QueryReader::number(std::string_view name, double low, double high) {
  const std::string* text = find(name);
  if (text == nullptr) return std::nullopt;
  double value = 0.0;
  const char* end = text->data() + text->size();
  const auto [stop, error] = std::from_chars(text->data(), end, value);
  if (error == std::errc() && stop == end && value >= low && value <= high) return value;
  fail(ProblemCode::kOutOfRange, name,
       "must be a number from " + std::to_string(low) + " to " + std::to_string(high));
  return std::nullopt;
}

std::optional<bool> QueryReader::flag(std::string_view name) {
  const std::string* text = find(name);
  if (text == nullptr) return std::nullopt;
  if (*text == "true") return true;
  if (*text == "false") return false;
  fail(ProblemCode::kInvalidValue, name, "must be true or false");
  return std::nullopt;
}

std::optional<Problem> check_query(const QueryParameters& parameters,
                                   std::initializer_list<std::string_view> known) {
  return QueryReader(parameters, known).problem();
}

Parsed<std::optional<std::uint64_t>> parse_at_version(const QueryParameters& query) {
  const auto given =
      std::find_if(query.begin(), query.end(), [](const auto& p) { return p.first == kAtVersion; });
  if (given == query.end()) return std::optional<std::uint64_t>();
  const QueryParameters alone{*given};
  QueryReader reader(alone, {kAtVersion});
  const std::uint64_t version = reader.integer(kAtVersion, 1, std::numeric_limits<std::uint64_t>::max(), 0);
  if (reader.problem()) return *reader.problem();
  return std::optional(version);
}

Parsed<Page> parse_page(const QueryParameters& query, std::size_t max_limit) {
  QueryReader reader(query, {"offset", "limit", kAtVersion});
  Page page;
  page.offset = reader.integer("offset", 0, 0xFFFFFFFFU, page.offset);
  page.limit = reader.integer("limit", 1, max_limit, std::min(page.limit, max_limit));
  if (reader.problem()) return *reader.problem();
  return page;
}

}  // namespace gridcast::proto
