#include "proto/geometry_reader.h"

#include <optional>
#include <string>

namespace gridcast::proto {
namespace {

/// One row of a transform: four numbers.
std::optional<glm::dvec4> read_row(const JsonNode& node) {
  const auto array = read_array(node);
  if (!array) return std::nullopt;
  if (array->size() != 4) {
    node.fail(ProblemCode::kWrongLength, "a row of a transform has 4 numbers");
    return std::nullopt;
  }
  glm::dvec4 row{0.0};
  int column = 0;
  for (const simdjson::dom::element element : *array) {
    row[column] = read_number(node.child(element, std::size_t(column)));
    ++column;
  }
  return row;
}

}  // namespace

Affine read_transform(const JsonNode& node) {
  Affine transform;
  const auto array = read_array(node);
  if (!array) return transform;
  if (array->size() != 3 && array->size() != 4) {
    node.fail(ProblemCode::kWrongLength, "a transform has 3 or 4 rows");
    return transform;
  }
  int r = 0;
  for (const simdjson::dom::element element : *array) {
    const JsonNode child = node.child(element, std::size_t(r));
    const auto row = read_row(child);
    if (!row || node.problems->any()) return transform;
    if (r < 3) {
      for (int c = 0; c < 3; ++c) transform.linear[c][r] = (*row)[c];
      transform.translation[r] = (*row)[3];
    } else if (*row != glm::dvec4(0.0, 0.0, 0.0, 1.0)) {
      child.fail(ProblemCode::kInvalidValue, "the last row of a 4x4 transform is [0, 0, 0, 1]");
    }
    ++r;
  }
  return transform;
}

void read_positions(const JsonNode& node, std::vector<Vec3f>& positions) {
  const auto array = read_array(node);
  if (!array) return;
  positions.reserve(array->size());
  for (const simdjson::dom::element element : *array) {
    const JsonNode child = node.child(element, positions.size());
    positions.emplace_back(read_vec3(child));
    // 1e39 is a fine double and no float.
    if (!is_finite(positions.back())) child.fail(ProblemCode::kOutOfRange, std::string(kPositionNotFinite));
    if (node.problems->any()) return;
  }
}

void read_vertex_ids(const JsonNode& node, std::size_t count, std::vector<std::uint32_t>& ids) {
  const auto array = read_array(node);
  if (!array) return;
  ids.reserve(count);
  for (const simdjson::dom::element element : *array) {
    ids.push_back(read_id(node.child(element, ids.size())));
    if (node.problems->any()) return;
  }
  if (ids.size() != count)
    node.fail(ProblemCode::kWrongLength, "must have one id per position, " + std::to_string(count));
}

}  // namespace gridcast::proto
