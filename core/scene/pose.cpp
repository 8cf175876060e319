#include "core/scene/pose.h"

namespace gridcast::scene {

Pose rest_pose(const SceneData& data, const Rig& rig) {
  auto nodes = std::make_shared<NodePoses>();
  nodes->locals.reserve(data.nodes.size());
  nodes->parts.reserve(data.nodes.size());
  for (const Node& node : data.nodes) {
    nodes->locals.push_back(node.local);
    nodes->parts.push_back(node.trs);
  }
  place_nodes(data, *nodes);
  Pose pose;
  pose.nodes = std::move(nodes);
  for (std::uint32_t m = 0; m < rig.meshes.size(); ++m) {
    const std::vector<float>& weights = rig.meshes[m].weights;
    if (!weights.empty()) pose.weights[m].assign(weights.begin(), weights.end());
  }
  return pose;
}

void place_nodes(const SceneData& data, NodePoses& nodes) {
  nodes.worlds.resize(data.nodes.size());
  for (std::size_t n = 0; n < data.nodes.size(); ++n) {
    const std::uint32_t parent = data.nodes[n].parent;
    nodes.worlds[n] = parent == kInvalidId ? nodes.locals[n] : nodes.worlds[parent] * nodes.locals[n];
  }
}

Affine skin_frame(const Rig& rig, std::uint32_t skin_id, const NodePoses& nodes) {
  const std::uint32_t root = rig.skin_root[skin_id];
  return {Mat3d(1.0), root == kInvalidId ? Vec3d(0.0) : nodes.worlds[root].translation};
}

std::vector<Affine> joint_matrices(const SceneData& data, const Rig& rig, const Pose& pose,
                                   std::uint32_t skin_id) {
  const Vec3d origin = skin_frame(rig, skin_id, *pose.nodes).translation;
  if (const auto given = pose.joints.find(skin_id); given != pose.joints.end()) {
    std::vector<Affine> matrices = given->second;
    for (Affine& matrix : matrices) matrix.translation -= origin;
    return matrices;
  }
  const Skin& skin = data.skins[skin_id];
  std::vector<Affine> matrices(skin.joints.size());
  for (std::size_t j = 0; j < matrices.size(); ++j) {
    Affine joint = pose.nodes->worlds[skin.joints[j]];
    // Subtracted first: the world may be far off, what the bind matrix adds is not.
    joint.translation -= origin;
    matrices[j] = joint * skin.inverse_bind[j];
  }
  return matrices;
}

std::optional<Affine> place_of(const SceneData& data, const Rig& rig, const NodePoses& nodes,
                               std::uint32_t instance_id) {
  const std::uint32_t skin_id = rig.meshes[rig.mesh_of_instance[instance_id]].skin_id;
  if (skin_id != kInvalidId) return skin_frame(rig, skin_id, nodes);
  const InstanceData& instance = data.instances[instance_id];
  if (instance.node == kInvalidId) return std::nullopt;
  const Affine& world = nodes.worlds[instance.node];
  return instance.entry == kInvalidId ? world : world * data.entries[instance.entry];
}

mesh::DeformedVertices posed_vertices(const SceneData& data, const Rig& rig, const Pose& pose,
                                      std::uint32_t mesh_id, const std::vector<Affine>& joints) {
  const std::uint32_t source = rig.meshes[mesh_id].source_mesh;
  const auto weights = pose.weights.find(mesh_id);
  const std::span<const double> given =
      weights == pose.weights.end() ? std::span<const double>() : std::span(weights->second);
  return deform(*data.meshes[source], data.deformations[source], given, joints);
}

std::size_t memory_bytes(const Pose& pose) {
  std::size_t bytes = pose.nodes->locals.capacity() * (2 * sizeof(Affine) + sizeof(Trs));
  for (const auto& [mesh, weights] : pose.weights) bytes += weights.capacity() * sizeof(double);
  for (const auto& [skin, joints] : pose.joints) bytes += joints.capacity() * sizeof(Affine);
  return bytes;
}

}  // namespace gridcast::scene
