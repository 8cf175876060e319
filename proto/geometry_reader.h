#pragma once
// Transforms, positions and ids in JSON, read the same way wherever they stand.

#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "core/math/affine.h"
#include "proto/json_reader.h"
#include "proto/limits.h"

namespace gridcast::proto {

inline constexpr std::string_view kPositionNotFinite = "a position must be finite as a 32-bit float";

/// Nested rows, 3x4 or 4x4: see scene_request.h.
[[nodiscard]] Affine read_transform(const JsonNode& node);
/// [[x,y,z]...], each finite after narrowing to float.
void read_positions(const JsonNode& node, std::vector<Vec3f>& positions);
/// `count` ids.
void read_vertex_ids(const JsonNode& node, std::size_t count, std::vector<std::uint32_t>& ids);

/// Parses `body` and hands its root to `read`, which returns the value.
template <class Read>
auto parse_body(std::string_view body, const Limits& limits, Read read)
    -> Parsed<decltype(read(std::declval<JsonNode>()))> {
  const auto document = JsonDocument::parse(body, limits.json_bytes, limits.json_depth);
  if (!document) return document.problem();
  JsonProblems problems;
  auto value = read(document.value().root(problems));
  if (problems.any()) return problems.first();
  return value;
}

}  // namespace gridcast::proto
