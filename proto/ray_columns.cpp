#include "proto/ray_columns.h"

#include <string>

namespace gridcast::proto {

std::optional<simdjson::dom::array> read_column(const JsonNode& node, std::size_t count,
                                                std::string_view what) {
  const auto array = read_array(node);
  if (!array || array->size() == count) return array;
  node.fail(ProblemCode::kWrongLength,
            "must have one entry per " + std::string(what) + ", " + std::to_string(count));
  return std::nullopt;
}

void read_vector_column(const JsonNode& node, std::string_view what, std::size_t columns, std::size_t first,
                        std::vector<double>& rows) {
  const auto array = read_column(node, rows.size() / columns, what);
  if (!array) return;
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    const Vec3d vector = read_vec3(node.child(element, i));
    if (node.problems->any()) return;
    double* row = rows.data() + columns * i++ + first;
    row[0] = vector.x;
    row[1] = vector.y;
    row[2] = vector.z;
  }
}

PrimitiveRef read_primitive_ref(const JsonNode& node) {
  PrimitiveRef ref;
  const auto array = read_array(node);
  if (!array) return ref;
  if (array->size() != 2) {
    node.fail(ProblemCode::kWrongLength, "must be [instance_id, primitive_id]");
    return ref;
  }
  ref.instance_id = read_id(node.child(array->at(0).value_unsafe(), 0));
  ref.primitive_id = read_id(node.child(array->at(1).value_unsafe(), 1));
  return ref;
}

}  // namespace gridcast::proto
