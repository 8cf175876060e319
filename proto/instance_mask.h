#pragma once
// Masks in JSON and in query strings, read the same way wherever they stand.

#include "core/math/instance_mask.h"
#include "proto/json_reader.h"
#include "proto/query.h"

namespace gridcast::proto {

/// Of an instance: 0, which no query sees, to 255.
[[nodiscard]] inline InstanceMask read_instance_mask(const JsonNode& node) {
  return InstanceMask(read_integer(node, 0, kFullMask));
}
/// Of a query: 1 to 255. One that sees nothing is a mistake.
[[nodiscard]] inline InstanceMask read_query_mask(const JsonNode& node) {
  return InstanceMask(read_integer(node, 1, kFullMask));
}
/// The same as a parameter; `fallback` when absent.
[[nodiscard]] inline InstanceMask query_mask(QueryReader& query, InstanceMask fallback) {
  return InstanceMask(query.integer("mask", 1, kFullMask, fallback));
}

}  // namespace gridcast::proto
