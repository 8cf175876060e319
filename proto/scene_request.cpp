#include "proto/scene_request.h"

#include <algorithm>
#include <unordered_set>

#include "proto/json_reader.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

constexpr std::string_view kSceneNameRule = "must be 1 to 64 letters, digits, '_', '.' or '-'";

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

std::vector<InstanceMove> read_moves(const JsonNode& node, const Limits& limits) {
  std::vector<InstanceMove> moves;
  const auto array = read_array(node);
  if (!array) return moves;
  if (array->size() > limits.instances_per_patch) {
    node.fail(ProblemCode::kOutOfRange,
              "at most " + std::to_string(limits.instances_per_patch) + " moves in one request");
    return moves;
  }
  moves.reserve(array->size());
  std::unordered_set<std::uint32_t> seen;
  for (const simdjson::dom::element element : *array) {
    const JsonNode child = node.child(element, moves.size());
    const ObjectReader move(child, {"instance_id", "transform"});
    const JsonNode* id = move.require("instance_id");
    const JsonNode* transform = move.require("transform");
    if (node.problems->any()) break;
    moves.push_back({read_id(*id), read_transform(*transform)});
    if (!seen.insert(moves.back().instance_id).second)
      id->fail(ProblemCode::kDuplicateId, "this instance is moved twice");
    if (node.problems->any()) break;
  }
  return moves;
}

}  // namespace

bool is_scene_name(std::string_view name) {
  const auto allowed = [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
           c == '.' || c == '-';
  };
  return !name.empty() && name.size() <= kMaxSceneNameBytes && name != "." && name != ".." &&
         std::all_of(name.begin(), name.end(), allowed);
}

Parsed<SceneQuery> parse_scene_query(const QueryParameters& query, const Limits& limits) {
  QueryReader reader(query, {"name", "structure", "scene"});
  SceneQuery scene;
  if (const std::string* name = reader.find("name")) {
    scene.name = *name;
    if (!is_scene_name(*name) || name->size() > limits.name_bytes)
      reader.fail(ProblemCode::kInvalidValue, "name", std::string(kSceneNameRule));
  }
  scene.structure = reader.choice("structure", kStructureNames, scene.structure);
  if (reader.find("scene") != nullptr)
    scene.gltf_scene = std::uint32_t(reader.integer("scene", 0, kInvalidId - 1, 0));
  if (reader.problem()) return *reader.problem();
  return scene;
}

Parsed<EmptySceneRequest> parse_empty_scene(std::string_view body, const Limits& limits) {
  return parse_body(body, limits, [&](const JsonNode& root) {
    EmptySceneRequest request;
    const ObjectReader object(root, {"name"});
    if (root.problems->any()) return request;
    if (const JsonNode* name = object.require("name")) {
      request.name = read_name(*name, limits.name_bytes);
      if (!is_scene_name(request.name)) name->fail(ProblemCode::kInvalidValue, std::string(kSceneNameRule));
    }
    return request;
  });
}

Parsed<AddInstanceRequest> parse_add_instance(std::string_view body, const Limits& limits) {
  return parse_body(body, limits, [&](const JsonNode& root) {
    AddInstanceRequest request;
    const ObjectReader object(root, {"mesh_id", "transform", "name"});
    if (root.problems->any()) return request;
    if (const JsonNode* mesh_id = object.require("mesh_id")) request.mesh_id = read_id(*mesh_id);
    if (const JsonNode* transform = object.find("transform"))
      request.world_from_object = read_transform(*transform);
    if (const JsonNode* name = object.find("name")) request.name = read_name(*name, limits.name_bytes);
    return request;
  });
}

Parsed<MoveInstanceRequest> parse_move_instance(std::string_view body, const Limits& limits) {
  return parse_body(body, limits, [](const JsonNode& root) {
    MoveInstanceRequest request;
    const ObjectReader object(root, {"transform"});
    if (root.problems->any()) return request;
    if (const JsonNode* transform = object.require("transform"))
      request.world_from_object = read_transform(*transform);
    return request;
  });
}

Parsed<std::vector<InstanceMove>> parse_move_instances(std::string_view body, const Limits& limits) {
  return parse_body(body, limits, [&](const JsonNode& root) {
    const ObjectReader object(root, {"moves"});
    const JsonNode* moves = root.problems->any() ? nullptr : object.require("moves");
    return moves == nullptr ? std::vector<InstanceMove>() : read_moves(*moves, limits);
  });
}

}  // namespace gridcast::proto
