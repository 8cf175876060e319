#include "proto/pose_request.h"

#include <cmath>
#include <span>

#include "proto/geometry_reader.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

constexpr std::array<std::string_view, 10> kPoseMembers{
    "op", "base", "animation", "animation_id", "time_s", "wrap", "nodes", "skins", "weights", "update"};

std::vector<double> read_numbers(const JsonNode& node) {
  std::vector<double> numbers;
  const auto array = read_array(node);
  if (!array) return numbers;
  numbers.reserve(array->size());
  for (const simdjson::dom::element element : *array) {
    numbers.push_back(read_number(node.child(element, numbers.size())));
    if (node.problems->any()) break;
  }
  return numbers;
}

/// Every element of an array, by `read`.
template <class T, class Read>
std::vector<T> read_list(const JsonNode& node, const Read& read) {
  std::vector<T> list;
  const auto array = read_array(node);
  if (!array) return list;
  list.reserve(array->size());
  for (const simdjson::dom::element element : *array) {
    list.push_back(read(node.child(element, list.size())));
    if (node.problems->any()) break;
  }
  return list;
}

/// `by_id` or `by_name`, which exclude each other; nothing when neither is there.
std::optional<FileElement> find_element(const ObjectReader& object, std::string_view by_id,
                                        std::string_view by_name, const Limits& limits) {
  const JsonNode *id = object.find(by_id), *name = object.find(by_name);
  if (id != nullptr && name != nullptr)
    name->fail(ProblemCode::kInvalidValue, "excludes " + std::string(by_id));
  if (id != nullptr) return FileElement(read_id(*id));
  if (name != nullptr) return FileElement(read_name(*name, limits.name_bytes));
  return std::nullopt;
}

FileElement require_element(const ObjectReader& object, std::string_view by_id, std::string_view by_name,
                            const Limits& limits) {
  if (auto element = find_element(object, by_id, by_name, limits)) return *std::move(element);
  (void)object.require(by_id);
  return FileElement(0U);
}

std::array<double, 4> read_rotation(const JsonNode& node) {
  std::array<double, 4> rotation{};
  const std::vector<double> numbers = read_numbers(node);
  if (numbers.size() == rotation.size())
    std::copy(numbers.begin(), numbers.end(), rotation.begin());
  else
    node.fail(ProblemCode::kWrongLength, "must have exactly 4 numbers");
  return rotation;
}

PoseNode read_node(const JsonNode& node, const Limits& limits) {
  const ObjectReader object(node, {"node_id", "node", "transform", "translation", "rotation", "scale"});
  PoseNode read{require_element(object, "node_id", "node", limits), {}, {}, {}, {}};
  if (const JsonNode* part = object.find("translation")) read.translation = read_vec3(*part);
  if (const JsonNode* part = object.find("rotation")) read.rotation = read_rotation(*part);
  if (const JsonNode* part = object.find("scale")) read.scale = read_vec3(*part);
  const JsonNode* transform = object.find("transform");
  if (transform == nullptr) return read;
  if (read.translation || read.rotation || read.scale)
    transform->fail(ProblemCode::kInvalidValue, "excludes translation, rotation and scale");
  read.transform = read_transform(*transform);
  return read;
}

PoseSkin read_skin(const JsonNode& node, const Limits& limits) {
  const ObjectReader object(node, {"skin_id", "skin", "joint_matrices"});
  PoseSkin skin{require_element(object, "skin_id", "skin", limits), {}};
  if (const JsonNode* matrices = object.require("joint_matrices"))
    skin.joint_matrices = read_list<Affine>(*matrices, [](const JsonNode& m) { return read_transform(m); });
  return skin;
}

PoseWeights read_weights(const ObjectReader& object) {
  PoseWeights weights;
  if (const JsonNode* mesh_id = object.require("mesh_id")) weights.mesh_id = read_id(*mesh_id);
  if (const JsonNode* numbers = object.require("weights")) weights.weights = read_numbers(*numbers);
  return weights;
}

void read_animation(const ObjectReader& object, const Limits& limits, PoseRequest& pose) {
  if (auto element = find_element(object, "animation_id", "animation", limits))
    pose.animation = PoseAnimation{*std::move(element)};
  for (const std::string_view name : {"time_s", "wrap"}) {
    const JsonNode* member = object.find(name);
    if (member == nullptr) continue;
    if (!pose.animation)
      member->fail(ProblemCode::kInvalidValue, "needs an animation");
    else if (name == "time_s")
      pose.animation->time_s = read_number(*member);
    else
      pose.animation->wrap = read_choice(*member, kWrapNames);
  }
}

PoseRequest read_pose(const JsonNode& node, std::span<const std::string_view> known, const Limits& limits) {
  const ObjectReader object(node, known);
  PoseRequest pose;
  if (node.problems->any()) return pose;
  if (const JsonNode* base = object.find("base")) pose.base = read_choice(*base, kPoseBaseNames);
  if (const JsonNode* update = object.find("update")) pose.update = read_choice(*update, kUpdateModeNames);
  read_animation(object, limits, pose);
  if (const JsonNode* nodes = object.find("nodes"))
    pose.nodes = read_list<PoseNode>(*nodes, [&](const JsonNode& n) { return read_node(n, limits); });
  if (const JsonNode* skins = object.find("skins"))
    pose.skins = read_list<PoseSkin>(*skins, [&](const JsonNode& n) { return read_skin(n, limits); });
  if (const JsonNode* weights = object.find("weights"))
    pose.weights = read_list<PoseWeights>(*weights, [](const JsonNode& n) {
      return read_weights(ObjectReader(n, {"mesh_id", "weights"}));
    });
  return pose;
}

/// With the query's `update` in place of the body's.
Parsed<PoseRequest> with_query(Parsed<PoseRequest> parsed, const QueryParameters& query) {
  if (!parsed) return parsed;
  QueryReader reader(query, {"update"});
  parsed->update = reader.choice("update", kUpdateModeNames, parsed->update);
  if (reader.problem()) return *reader.problem();
  return parsed;
}

}  // namespace

Parsed<PoseRequest> parse_pose_request(std::string_view body, const QueryParameters& query,
                                       const Limits& limits) {
  const auto read = [&](const JsonNode& root) {
    return read_pose(root, std::span(kPoseMembers).subspan(1), limits);
  };
  return with_query(parse_body(body, limits, read), query);
}

Parsed<PoseRequest> parse_weights_request(std::uint32_t mesh_id, std::string_view body,
                                          const QueryParameters& query, const Limits& limits) {
  const auto read = [&](const JsonNode& root) {
    PoseRequest pose;
    pose.base = "present";
    const ObjectReader object(root, {"weights", "update"});
    if (root.problems->any()) return pose;
    if (const JsonNode* weights = object.require("weights"))
      pose.weights = {{mesh_id, read_numbers(*weights)}};
    if (const JsonNode* update = object.find("update")) pose.update = read_choice(*update, kUpdateModeNames);
    return pose;
  };
  return with_query(parse_body(body, limits, read), query);
}

PoseRequest read_pose_edit(const JsonNode& node, const Limits& limits) {
  return read_pose(node, kPoseMembers, limits);
}

PoseRequest read_weights_edit(const JsonNode& node) {
  PoseRequest pose;
  pose.base = "present";
  const ObjectReader object(node, {"op", "mesh_id", "weights", "update"});
  if (node.problems->any()) return pose;
  pose.weights = {read_weights(object)};
  if (const JsonNode* update = object.find("update")) pose.update = read_choice(*update, kUpdateModeNames);
  return pose;
}

}  // namespace gridcast::proto
