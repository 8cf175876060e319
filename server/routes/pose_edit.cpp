#include "server/routes/pose_edit.h"

#include <algorithm>
#include <utility>

#include "core/scene/pose.h"
#include "proto/vocabulary.h"

namespace gridcast::server {

scene::SetPose pose_edit(proto::PoseRequest request) {
  scene::SetPose edit;
  edit.base = request.base == "present" ? scene::PoseBase::kPresent : scene::PoseBase::kRest;
  edit.mode = scene::parse_update_mode(request.update).value();
  if (request.animation)
    edit.animation = scene::AnimationTime{
        std::move(request.animation->animation), request.animation->time_s,
        request.animation->wrap == "loop" ? scene::AnimationWrap::kLoop : scene::AnimationWrap::kClamp};
  for (proto::PoseNode& node : request.nodes) {
    scene::NodeTransform& to = edit.nodes.emplace_back();
    to.node = std::move(node.node);
    if (node.transform)
      to.parent_from_node = *node.transform;
    else
      to.parent_from_node = scene::TrsParts{node.translation, node.rotation, node.scale};
  }
  for (proto::PoseSkin& skin : request.skins)
    edit.skins.push_back({std::move(skin.skin), std::move(skin.joint_matrices)});
  for (proto::PoseWeights& mesh : request.weights)
    edit.weights.push_back({mesh.mesh_id, std::move(mesh.weights)});
  return edit;
}

proto::PoseRequest pose_request(const scene::SetPose& edit) {
  proto::PoseRequest request;
  request.base = proto::kPoseBaseNames[std::size_t(edit.base)];
  request.update = to_string(edit.mode);
  if (edit.animation)
    request.animation =
        proto::PoseAnimation{edit.animation->animation, edit.animation->time_s,
                             std::string(proto::kWrapNames[std::size_t(edit.animation->wrap)])};
  for (const scene::NodeTransform& node : edit.nodes) {
    proto::PoseNode& to = request.nodes.emplace_back();
    to.node = node.node;
    if (const auto* transform = std::get_if<Affine>(&node.parent_from_node)) {
      to.transform = *transform;
      continue;
    }
    const auto& parts = std::get<scene::TrsParts>(node.parent_from_node);
    to.translation = parts.translation;
    to.rotation = parts.rotation;
    to.scale = parts.scale;
  }
  for (const scene::SkinJoints& skin : edit.skins) request.skins.push_back({skin.skin, skin.joint_matrices});
  for (const scene::MorphWeights& mesh : edit.weights)
    request.weights.push_back({mesh.mesh_id, mesh.weights});
  return request;
}

proto::PosedMesh posed_mesh(const scene::MeshUpdateReport& report) {
  return {report.mesh_id,    std::string(to_string(report.action)),
          report.reason,     report.cost_before,
          report.cost_after, report.ms};
}

std::vector<proto::PosedMesh> posed_meshes(const std::vector<scene::MeshUpdateReport>& reports) {
  std::vector<proto::PosedMesh> meshes;
  meshes.reserve(reports.size());
  for (const scene::MeshUpdateReport& report : reports) meshes.push_back(posed_mesh(report));
  return meshes;
}

proto::PosedMesh unchanged_mesh(const scene::Scene& scene, std::uint32_t mesh_id) {
  const double cost = scene.blas(mesh_id).stats().cost;
  return {mesh_id, "none", "The pose does not change it.", cost, cost, 0.0};
}

std::optional<proto::PlayedAnimation> played_animation(const scene::Scene& scene) {
  const auto& moment = scene.pose().animation;
  if (!moment) return std::nullopt;
  return proto::PlayedAnimation{moment->animation_id, scene.data().animations[moment->animation_id].name,
                                moment->time_s};
}

proto::PoseInfo pose_info(const scene::Scene& scene, std::size_t offset, std::size_t limit) {
  const scene::SceneData& data = scene.data();
  const scene::Pose& pose = scene.pose();
  proto::PoseInfo info;
  info.scene_version = scene.version();
  info.animation = played_animation(scene);
  info.node_count = data.nodes.size();
  const std::size_t begin = std::min(offset, data.nodes.size());
  const std::size_t end = begin + std::min(limit, data.nodes.size() - begin);
  for (std::size_t n = begin; n < end; ++n) {
    proto::PoseInfo::Node& node = info.nodes.emplace_back();
    node.node_id = scene::node_id(data, std::uint32_t(n));
    node.name = data.nodes[n].name;
    if (data.nodes[n].parent != kInvalidId) node.parent_id = scene::node_id(data, data.nodes[n].parent);
    node.parent_from_node = pose.nodes->locals[n];
  }
  if (end < data.nodes.size()) info.next_offset = end;
  for (const auto& [skin_id, joints] : pose.joints) info.skins.push_back({skin_id, joints});
  for (const auto& [mesh_id, weights] : pose.weights) info.weights.push_back({mesh_id, weights});
  return info;
}

}  // namespace gridcast::server
