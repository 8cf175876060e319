#include "core/scene/rig.h"

#include <algorithm>
#include <tuple>
#include <unordered_set>

namespace gridcast::scene {
namespace {

std::vector<float> weights_at_rest(const MeshDeformation& deformation, const std::vector<float>& of_node) {
  std::vector<float> weights = of_node.empty() ? deformation.default_weights : of_node;
  weights.resize(deformation.morph_targets.size(), 0.F);
  return weights;
}

std::unordered_set<std::uint32_t> nodes_with_animated_weights(const SceneData& data) {
  std::unordered_set<std::uint32_t> nodes;
  for (const Animation& animation : data.animations)
    for (const AnimationChannel& channel : animation.channels)
      if (channel.path == AnimationPath::kWeights) nodes.insert(channel.node);
  return nodes;
}

std::uint32_t root_of(const SceneData& data, const Skin& skin) {
  if (skin.joints.empty()) return kInvalidId;
  const std::unordered_set<std::uint32_t> joints(skin.joints.begin(), skin.joints.end());
  std::uint32_t node = data.nodes[skin.joints[0]].parent;
  while (node != kInvalidId && joints.contains(node)) node = data.nodes[node].parent;
  return node;
}

/// Gives every instance its mesh, and makes the copies that are needed.
class RigMaker {
 public:
  explicit RigMaker(const SceneData& data) : data_(data), animated_(nodes_with_animated_weights(data)) {}

  Rig run() {
    rig_.meshes.resize(data_.meshes.size());
    taken_.assign(data_.meshes.size(), false);
    for (const InstanceData& instance : data_.instances) rig_.mesh_of_instance.push_back(mesh_of(instance));
    for (std::uint32_t m = 0; m < data_.meshes.size(); ++m)
      if (!taken_[m]) rig_.meshes[m] = make_mesh(m, kInvalidId, {});
    for (const Skin& skin : data_.skins) rig_.skin_root.push_back(root_of(data_, skin));
    rig_.node_of_id.reserve(data_.nodes.size());
    for (std::uint32_t n = 0; n < data_.nodes.size(); ++n) rig_.node_of_id.emplace(node_id(data_, n), n);
    return std::move(rig_);
  }

 private:
  /// Instances with the same key show the same vertices in every pose.
  using Key = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::vector<float>>;

  [[nodiscard]] const MeshDeformation* deformation_of(std::uint32_t mesh) const {
    return mesh < data_.deformations.size() && !data_.deformations[mesh].empty() ? &data_.deformations[mesh]
                                                                                 : nullptr;
  }

  RigMesh make_mesh(std::uint32_t source, std::uint32_t skin, const std::vector<float>& of_node) const {
    RigMesh mesh{source, skin, {}, false};
    if (const MeshDeformation* deformation = deformation_of(source)) {
      mesh.weights = weights_at_rest(*deformation, of_node);
      mesh.deforms = skin != kInvalidId || !deformation->morph_targets.empty();
    }
    return mesh;
  }

  std::uint32_t mesh_of(const InstanceData& instance) {
    const std::uint32_t source = instance.mesh_id, node = instance.node;
    const MeshDeformation* deformation = deformation_of(source);
    if (deformation == nullptr) {
      if (!taken_[source]) rig_.meshes[source] = make_mesh(source, kInvalidId, {});
      taken_[source] = true;
      return source;
    }
    const std::uint32_t skin = deformation->influences == 0 ? kInvalidId : instance.skin_id;
    const RigMesh mesh =
        make_mesh(source, skin, node == kInvalidId ? std::vector<float>{} : data_.nodes[node].weights);
    const bool driven = !mesh.weights.empty() && animated_.contains(node);
    auto [known, is_new] =
        known_.try_emplace(Key{source, skin, driven ? node : kInvalidId, mesh.weights}, source);
    if (is_new && !taken_[source]) {
      rig_.meshes[source] = mesh;
      taken_[source] = true;
    } else if (is_new) {
      known->second = std::uint32_t(rig_.meshes.size());
      rig_.meshes.push_back(mesh);
    }
    if (driven) rig_.mesh_of_node[node] = known->second;
    return known->second;
  }

  const SceneData& data_;
  std::unordered_set<std::uint32_t> animated_;
  std::vector<bool> taken_;
  std::map<Key, std::uint32_t> known_;
  Rig rig_;
};

}  // namespace

std::uint32_t node_id(const SceneData& data, std::uint32_t node) {
  const std::uint32_t in_file = data.nodes[node].file_index;
  return in_file == kInvalidId ? node : in_file;
}

Rig make_rig(const SceneData& data) {
  return RigMaker(data).run();
}

}  // namespace gridcast::scene
