#pragma once
// Columns of JSON bodies: one entry for every ray or pair of points.

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "core/math/ray.h"
#include "proto/json_reader.h"

namespace gridcast::proto {

/// Checks that a column is an array of `count` values, one per `what`.
[[nodiscard]] std::optional<simdjson::dom::array> read_column(const JsonNode& node, std::size_t count,
                                                              std::string_view what);
/// Points or directions into three columns, from `first` on, of row-major `rows` with `columns` columns.
void read_vector_column(const JsonNode& node, std::string_view what, std::size_t columns, std::size_t first,
                        std::vector<double>& rows);
/// [instance_id, primitive_id]
[[nodiscard]] PrimitiveRef read_primitive_ref(const JsonNode& node);

/// One entry per `what`, read by `read`; null keeps the default.
template <class T>
void read_entries(const JsonNode& node, std::string_view what, std::size_t count, std::vector<T>& entries,
                  T (*read)(const JsonNode&)) {
  const auto array = read_column(node, count, what);
  if (!array) return;
  entries.resize(count);
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    if (!element.is_null()) entries[i] = read(node.child(element, i));
    if (node.problems->any()) return;
    ++i;
  }
}

}  // namespace gridcast::proto
