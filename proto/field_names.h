#pragma once
// Which columns of an answer are wanted, as names: `"fields": ["uv", "normal"]` or `?fields=uv,normal`.

#include <algorithm>
#include <span>
#include <string_view>

#include "proto/json_reader.h"
#include "proto/query.h"

namespace gridcast::proto {

/// The set that an array names. `parse(name)` gives the Field of one of `names`; any other name is a problem
/// that lists them.
template <class Field, class Parse>
Field read_fields(const JsonNode& node, std::span<const std::string_view> names, Parse parse) {
  Field fields{};
  const auto array = read_array(node);
  if (!array) return fields;
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    const JsonNode name = node.child(element, i++);
    fields = fields | parse(read_choice(name, names)).value_or(Field{});
    if (node.problems->any()) break;
  }
  return fields;
}

/// The same of the parameter `fields`; `fallback` where it is absent.
template <class Field, class Parse>
Field read_query_fields(QueryReader& query, std::span<const std::string_view> names, Parse parse,
                        Field fallback) {
  const std::string* list = query.find("fields");
  if (list == nullptr) return fallback;
  Field fields{};
  std::string_view rest = *list;
  while (!rest.empty()) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    const auto field = parse(rest.substr(0, comma));
    if (!field) query.fail(ProblemCode::kInvalidValue, "fields", list_choices(names));
    fields = fields | field.value_or(Field{});
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  return fields;
}

}  // namespace gridcast::proto
