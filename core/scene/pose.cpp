#include "core/scene/pose.h"

namespace gridcast::scene {

std::vector<Affine> rest_worlds(const SceneData& data) {
  std::vector<Affine> worlds(data.nodes.size());
  for (std::size_t n = 0; n < data.nodes.size(); ++n) {
    const Node& node = data.nodes[n];
    worlds[n] = node.parent == kInvalidId ? node.local : worlds[node.parent] * node.local;
  }
  return worlds;
}

Affine skin_frame(const Rig& rig, std::uint32_t skin_id, const std::vector<Affine>& worlds) {
  const std::uint32_t root = rig.skin_root[skin_id];
  return {Mat3d(1.0), root == kInvalidId ? Vec3d(0.0) : worlds[root].translation};
}

std::vector<Affine> joint_matrices(const SceneData& data, const Rig& rig, std::uint32_t skin_id,
                                   const std::vector<Affine>& worlds) {
  const Skin& skin = data.skins[skin_id];
  const Vec3d origin = skin_frame(rig, skin_id, worlds).translation;
  std::vector<Affine> matrices(skin.joints.size());
  for (std::size_t j = 0; j < matrices.size(); ++j) {
    Affine joint = worlds[skin.joints[j]];
    // Subtracted first: the world may be far off, what the bind matrix adds is not.
    joint.translation -= origin;
    matrices[j] = joint * skin.inverse_bind[j];
  }
  return matrices;
}

mesh::DeformedVertices posed_vertices(const SceneData& data, const Rig& rig, std::uint32_t mesh_id,
                                      const std::vector<float>& weights, const std::vector<Affine>& worlds) {
  const RigMesh& mesh = rig.meshes[mesh_id];
  std::vector<Affine> joints;
  if (mesh.skin_id != kInvalidId) joints = joint_matrices(data, rig, mesh.skin_id, worlds);
  return deform(*data.meshes[mesh.source_mesh], data.deformations[mesh.source_mesh], weights, joints);
}

}  // namespace gridcast::scene
