#include "proto/pose_reply.h"

#include "proto/replies_json.h"

namespace gridcast::proto {
namespace {

using Json = nlohmann::ordered_json;

Json animation_json(const std::optional<PlayedAnimation>& animation) {
  if (!animation) return nullptr;
  return {
      {"animation_id", animation->animation_id}, {"name", animation->name}, {"time_s", animation->time_s}};
}

template <class T>
Json optional_json(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

}  // namespace

std::string to_json(const PoseReply& reply) {
  Json json = {{"scene_version", std::to_string(reply.scene_version)},
               {"animation", animation_json(reply.animation)},
               {"moved_instances", reply.moved_instances},
               {"inactive_instances", reply.inactive_instances},
               {"meshes", Json::array()},
               {"ms", reply.ms}};
  for (const PosedMesh& mesh : reply.meshes) json["meshes"].push_back(posed_mesh_json(mesh));
  return dump_json(json);
}

std::string to_json(const WeightsReply& reply) {
  Json json = {{"scene_version", std::to_string(reply.scene_version)}};
  json.update(posed_mesh_json(reply.mesh));
  return dump_json(json);
}

std::string to_json(const WeightsInfo& info) {
  return dump_json({{"scene_version", std::to_string(info.scene_version)},
                    {"mesh_id", info.mesh_id},
                    {"weights", info.weights}});
}

std::string to_json(const PoseInfo& info) {
  Json json = {{"scene_version", std::to_string(info.scene_version)},
               {"animation", animation_json(info.animation)},
               {"node_count", info.node_count},
               {"nodes", Json::array()},
               {"next_offset", optional_json(info.next_offset)},
               {"skins", Json::array()},
               {"weights", Json::array()}};
  for (const PoseInfo::Node& node : info.nodes)
    json["nodes"].push_back({{"node_id", node.node_id},
                             {"name", node.name},
                             {"parent_id", optional_json(node.parent_id)},
                             {"transform", transform_json(node.parent_from_node)}});
  for (const PoseInfo::Skin& skin : info.skins) {
    Json matrices = Json::array();
    for (const Affine& matrix : skin.joint_matrices) matrices.push_back(transform_json(matrix));
    json["skins"].push_back({{"skin_id", skin.skin_id}, {"joint_matrices", std::move(matrices)}});
  }
  for (const PoseInfo::Weights& mesh : info.weights)
    json["weights"].push_back({{"mesh_id", mesh.mesh_id}, {"weights", mesh.weights}});
  return dump_json(json);
}

nlohmann::ordered_json posed_mesh_json(const PosedMesh& mesh) {
  return {{"mesh_id", mesh.mesh_id},         {"action", mesh.action},         {"reason", mesh.reason},
          {"cost_before", mesh.cost_before}, {"cost_after", mesh.cost_after}, {"ms", mesh.ms}};
}

}  // namespace gridcast::proto
