#include "proto/transaction.h"

#include <array>

#include "proto/geometry_reader.h"
#include "proto/instance_reader.h"
#include "proto/replies_json.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

void read_add(const JsonNode& node, const Limits& limits, AddInstanceRequest& edit) {
  edit = read_added_instance(ObjectReader(node, {"op", "mesh_id", "transform", "name", "mask"}), limits);
}

void read_change_edit(const JsonNode& node, const Limits& limits, InstanceChange& edit) {
  const ObjectReader object(node, {"op", "instance_id", "transform", "mask", "name"});
  if (const JsonNode* id = object.require("instance_id")) edit.instance_id = read_id(*id);
  edit.change = read_change(node, object, limits);
}

void read_move(const JsonNode& node, InstanceMove& edit) {
  const ObjectReader object(node, {"op", "instance_id", "transform"});
  if (const JsonNode* id = object.require("instance_id")) edit.instance_id = read_id(*id);
  if (const JsonNode* transform = object.require("transform"))
    edit.world_from_object = read_transform(*transform);
}

void read_remove(const JsonNode& node, RemoveInstanceRequest& edit) {
  const ObjectReader object(node, {"op", "instance_id"});
  if (const JsonNode* id = object.require("instance_id")) edit.instance_id = read_id(*id);
}

void read_vertices(const JsonNode& node, MeshVerticesRequest& edit) {
  const ObjectReader object(node, {"op", "mesh_id", "positions", "vertex_ids", "update"});
  VertexRequest& vertices = edit.vertices;
  if (const JsonNode* mesh_id = object.require("mesh_id")) edit.mesh_id = read_id(*mesh_id);
  const JsonNode* positions = object.require("positions");
  if (positions == nullptr) return;
  read_positions(*positions, vertices.positions);
  if (vertices.positions.empty())
    positions->fail(ProblemCode::kWrongLength, "must have at least one position");
  if (const JsonNode* ids = object.find("vertex_ids"); ids != nullptr && !node.problems->any())
    read_vertex_ids(*ids, vertices.positions.size(), vertices.vertex_ids);
  if (const JsonNode* update = object.find("update"))
    vertices.update = read_choice(*update, kUpdateModeNames);
}

/// The member `op` of an object whose other members it decides about.
std::string read_op(const JsonNode& node) {
  simdjson::dom::object object;
  simdjson::dom::element value;
  if (node.value.get(object) != simdjson::SUCCESS) {
    node.fail(ProblemCode::kWrongType, "must be an object");
    return {};
  }
  const JsonNode op{{}, node.problems, &node, "op", 0};
  if (object.at_key("op").get(value) != simdjson::SUCCESS) {
    op.fail(ProblemCode::kMissingField, "is required");
    return {};
  }
  return read_choice({value, node.problems, &node, "op", 0}, kEditNames);
}

TransactionEdit read_edit(const JsonNode& node, const Limits& limits) {
  const std::string op = read_op(node);
  if (node.problems->any()) return RemoveInstanceRequest{};
  const auto read = [&](auto edit, const auto& reader) {
    reader(edit);
    return TransactionEdit(std::move(edit));
  };
  if (op == kEditNames[0])
    return read(AddInstanceRequest{}, [&](auto& edit) { read_add(node, limits, edit); });
  if (op == kEditNames[1]) return read(InstanceMove{}, [&](auto& edit) { read_move(node, edit); });
  if (op == kEditNames[2]) return read(RemoveInstanceRequest{}, [&](auto& edit) { read_remove(node, edit); });
  if (op == kEditNames[4]) return PoseEditRequest{op, read_pose_edit(node, limits)};
  if (op == kEditNames[5]) return PoseEditRequest{op, read_weights_edit(node)};
  if (op == kEditNames[6])
    return read(InstanceChange{}, [&](auto& edit) { read_change_edit(node, limits, edit); });
  return read(MeshVerticesRequest{}, [&](auto& edit) { read_vertices(node, edit); });
}

std::vector<TransactionEdit> read_edits(const JsonNode& node, const Limits& limits) {
  std::vector<TransactionEdit> edits;
  const auto array = read_array(node);
  if (!array) return edits;
  if (array->size() < 1 || array->size() > limits.transaction_edits) {
    node.fail(ProblemCode::kOutOfRange,
              "must have 1 to " + std::to_string(limits.transaction_edits) + " edits");
    return edits;
  }
  edits.reserve(array->size());
  std::size_t poses = 0;
  for (const simdjson::dom::element element : *array) {
    const JsonNode child = node.child(element, edits.size());
    edits.push_back(read_edit(child, limits));
    if (std::holds_alternative<PoseEditRequest>(edits.back()) && ++poses > limits.transaction_poses)
      child.fail(ProblemCode::kOutOfRange,
                 "is one of more than " + std::to_string(limits.transaction_poses) + " poses");
    if (node.problems->any()) break;
  }
  return edits;
}

nlohmann::ordered_json edit_json(const EditReply& edit) {
  nlohmann::ordered_json json = {{"op", edit.op}};
  if (edit.instance_id) json["instance_id"] = *edit.instance_id;
  if (edit.mesh_id) json["mesh_id"] = *edit.mesh_id;
  if (edit.vertices) {
    json["action"] = edit.vertices->action;
    json["reason"] = edit.vertices->reason;
    json["cost_before"] = edit.vertices->cost_before;
    json["cost_after"] = edit.vertices->cost_after;
  }
  if (edit.pose) {
    json["moved_instances"] = edit.pose->moved_instances;
    json["meshes"] = nlohmann::ordered_json::array();
    for (const PosedMesh& mesh : edit.pose->meshes) json["meshes"].push_back(posed_mesh_json(mesh));
  }
  return json;
}

}  // namespace

Parsed<std::vector<TransactionEdit>> parse_transaction(std::string_view body, const Limits& limits) {
  return parse_body(body, limits, [&](const JsonNode& root) {
    const ObjectReader object(root, {"edits"});
    const JsonNode* edits = root.problems->any() ? nullptr : object.require("edits");
    return edits == nullptr ? std::vector<TransactionEdit>() : read_edits(*edits, limits);
  });
}

std::string to_json(const TransactionReply& reply) {
  nlohmann::ordered_json json = {{"scene_version", std::to_string(reply.scene_version)},
                                 {"edits", nlohmann::ordered_json::array()},
                                 {"ms", reply.ms}};
  for (const EditReply& edit : reply.edits) json["edits"].push_back(edit_json(edit));
  return json.dump();
}

}  // namespace gridcast::proto
