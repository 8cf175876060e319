#include "proto/scene_request.h"

#include <algorithm>
#include <cstring>
#include <unordered_set>

#include "proto/geometry_reader.h"
#include "proto/instance_reader.h"
#include "proto/json_reader.h"
#include "proto/media_type.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

constexpr std::string_view kSceneNameRule = "must be 1 to 64 letters, digits, '_', '.' or '-'";

bool is_move(const InstanceChange& one) {
  return one.change.world_from_object && !one.change.mask && !one.change.name;
}

InstancePatch patch_of(std::vector<InstanceChange> changes) {
  InstancePatch patch;
  if (!std::ranges::all_of(changes, is_move)) {
    patch.changes = std::move(changes);
    return patch;
  }
  patch.moves.reserve(changes.size());
  for (const InstanceChange& one : changes)
    patch.moves.push_back({one.instance_id, *one.change.world_from_object});
  return patch;
}

std::vector<InstanceChange> read_changes(const JsonNode& node, const Limits& limits) {
  std::vector<InstanceChange> changes;
  const auto array = read_array(node);
  if (!array) return changes;
  if (array->size() > limits.instances_per_patch) {
    node.fail(ProblemCode::kOutOfRange,
              "at most " + std::to_string(limits.instances_per_patch) + " moves in one request");
    return changes;
  }
  changes.reserve(array->size());
  std::unordered_set<std::uint32_t> seen;
  for (const simdjson::dom::element element : *array) {
    const JsonNode child = node.child(element, changes.size());
    const ObjectReader object(child, {"instance_id", "transform", "mask", "name"});
    const JsonNode* id = object.require("instance_id");
    if (node.problems->any()) break;
    changes.push_back({read_id(*id), read_change(child, object, limits)});
    if (!seen.insert(changes.back().instance_id).second)
      id->fail(ProblemCode::kDuplicateId, "this instance is moved twice");
    if (node.problems->any()) break;
  }
  return changes;
}

template <class Scalar>
Affine affine_of_rows(const char* bytes) {
  Scalar rows[3][4];
  std::memcpy(rows, bytes, sizeof(rows));
  Affine transform;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) transform.linear[c][r] = double(rows[r][c]);
    transform.translation[r] = double(rows[r][3]);
  }
  return transform;
}

/// The first id that was there before, nothing when each is there once.
std::optional<std::size_t> find_repeated(const std::vector<InstanceMove>& moves) {
  std::vector<std::uint32_t> ids;
  ids.reserve(moves.size());
  for (const InstanceMove& move : moves) ids.push_back(move.instance_id);
  std::sort(ids.begin(), ids.end());
  if (std::adjacent_find(ids.begin(), ids.end()) == ids.end()) return std::nullopt;
  std::unordered_set<std::uint32_t> seen;
  std::size_t i = 0;
  while (seen.insert(moves[i].instance_id).second) ++i;
  return i;
}

Parsed<InstancePatch> parse_binary_moves(const MediaType& type, std::string_view body, const Limits& limits) {
  bool is_float = false;
  for (const auto& [name, value] : type.parameters) {
    if (name != "dtype" || (value != "float32" && value != "float64"))
      return Problem{ProblemCode::kUnsupportedMediaType,
                     std::string(kInstancesMediaType) + " takes dtype=float64|float32", "Content-Type"};
    is_float = value == "float32";
  }
  if (body.size() > limits.binary_bytes)
    return Problem{ProblemCode::kPayloadTooLarge,
                   "binary moves may have at most " + std::to_string(limits.binary_bytes) + " bytes", ""};
  const std::size_t matrix_bytes = 12 * (is_float ? sizeof(float) : sizeof(double));
  const std::size_t move_bytes = sizeof(std::uint32_t) + matrix_bytes;
  if (body.empty() || body.size() % move_bytes != 0)
    return Problem{ProblemCode::kWrongLength,
                   "the body is not a whole number of moves of " + std::to_string(move_bytes) + " bytes", ""};
  const std::size_t count = body.size() / move_bytes;
  if (count > limits.binary_instances)
    return Problem{ProblemCode::kOutOfRange,
                   "at most " + std::to_string(limits.binary_instances) + " moves in one request", "/moves"};
  std::vector<InstanceMove> moves(count);
  const char* matrices = body.data() + count * sizeof(std::uint32_t);
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(&moves[i].instance_id, body.data() + i * sizeof(std::uint32_t), sizeof(std::uint32_t));
    const char* matrix = matrices + i * matrix_bytes;
    moves[i].world_from_object = is_float ? affine_of_rows<float>(matrix) : affine_of_rows<double>(matrix);
  }
  if (const auto i = find_repeated(moves))
    return Problem{ProblemCode::kDuplicateId, "this instance is moved twice",
                   "/moves/" + std::to_string(*i) + "/instance_id"};
  return InstancePatch{std::move(moves), {}};
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
  QueryReader reader(query, {"name", "structure", "quality", "scene"});
  SceneQuery scene;
  if (const std::string* name = reader.find("name")) {
    scene.name = *name;
    if (!is_scene_name(*name) || name->size() > limits.name_bytes)
      reader.fail(ProblemCode::kInvalidValue, "name", std::string(kSceneNameRule));
  }
  scene.structure = reader.choice("structure", kStructureNames, scene.structure);
  scene.quality = reader.choice("quality", kBuildQualityNames, scene.quality);
  if (reader.find("scene") != nullptr)
    scene.gltf_scene = std::uint32_t(reader.integer("scene", 0, kInvalidId - 1, 0));
  if (reader.problem()) return *reader.problem();
  return scene;
}

Parsed<std::string> parse_fork_query(const QueryParameters& query) {
  QueryReader reader(query, {"name", kAtVersion});
  const std::string* name = reader.find("name");
  if (name != nullptr && !is_scene_name(*name))
    reader.fail(ProblemCode::kInvalidValue, "name", std::string(kSceneNameRule));
  if (reader.problem()) return *reader.problem();
  return name == nullptr ? std::string() : *name;
}

Parsed<StructureQuery> parse_structure_query(const QueryParameters& query, const Limits& limits) {
  QueryReader reader(query, {"steps", "deadline_ms", kAtVersion});
  StructureQuery asked;
  asked.steps = reader.integer("steps", 1, kMaxCountedRays, 0);
  asked.deadline_ms = reader.number("deadline_ms", 1e-3, limits.deadline_ms);
  if (reader.problem()) return *reader.problem();
  return asked;
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
    const ObjectReader object(root, {"mesh_id", "transform", "name", "mask"});
    return root.problems->any() ? AddInstanceRequest() : read_added_instance(object, limits);
  });
}

Parsed<ChangeInstanceRequest> parse_change_instance(std::string_view body, const Limits& limits) {
  return parse_body(body, limits, [&](const JsonNode& root) {
    const ObjectReader object(root, {"transform", "mask", "name"});
    return root.problems->any() ? ChangeInstanceRequest() : read_change(root, object, limits);
  });
}

Parsed<InstancePatch> parse_move_instances(std::string_view content_type, std::string_view body,
                                           const Limits& limits) {
  const auto type = parse_media_type(content_type);
  if (type && type->essence == kInstancesMediaType) return parse_binary_moves(*type, body, limits);
  if (!type || type->essence != kJsonMediaType)
    return Problem{ProblemCode::kUnsupportedMediaType,
                   "moves come as " + std::string(kJsonMediaType) + " or " + std::string(kInstancesMediaType),
                   "Content-Type"};
  return parse_body(body, limits, [&](const JsonNode& root) {
    const ObjectReader object(root, {"moves"});
    const JsonNode* moves = root.problems->any() ? nullptr : object.require("moves");
    return moves == nullptr ? InstancePatch() : patch_of(read_changes(*moves, limits));
  });
}

}  // namespace gridcast::proto
