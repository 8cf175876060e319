#include <string>

#include "core/scene/animation.h"
#include "core/scene/rig.h"

namespace gridcast::scene {
namespace {

Error invalid(std::string message, std::string where) {
  return {ErrorCode::kInvalidArgument, std::move(message), std::move(where)};
}

Status check_nodes(const SceneData& data) {
  for (std::size_t n = 0; n < data.nodes.size(); ++n) {
    const std::string where = "/nodes/" + std::to_string(n);
    const Node& node = data.nodes[n];
    if (node.parent != kInvalidId && node.parent >= n)
      return invalid("a parent must come before its children", where + "/parent");
    if (!is_finite(node.local)) return invalid("the node's transform is not finite", where + "/local");
  }
  return ok_status();
}

Status check_skins(const SceneData& data) {
  for (std::size_t s = 0; s < data.skins.size(); ++s) {
    const std::string where = "/skins/" + std::to_string(s);
    const Skin& skin = data.skins[s];
    for (const std::uint32_t joint : skin.joints)
      if (joint >= data.nodes.size())
        return invalid("a joint names a node that does not exist", where + "/joints");
    if (skin.inverse_bind.size() != skin.joints.size())
      return invalid("there must be one inverse bind matrix per joint", where + "/inverse_bind");
  }
  return ok_status();
}

Status check_deformations(const SceneData& data) {
  for (std::size_t m = 0; m < data.deformations.size() && m < data.meshes.size(); ++m) {
    if (Status status = mesh::validate(data.deformations[m], data.meshes[m]->positions.size()); !status) {
      return Error{status.error().code, status.error().message,
                   "/deformations/" + std::to_string(m) + status.error().where};
    }
  }
  return ok_status();
}

/// The largest joint that each mesh names.
std::vector<std::uint32_t> largest_joints(const SceneData& data) {
  std::vector<std::uint32_t> largest(data.meshes.size(), kInvalidId);
  for (std::size_t m = 0; m < data.deformations.size() && m < largest.size(); ++m)
    largest[m] = mesh::largest_joint(data.deformations[m]);
  return largest;
}

Status check_instances(const SceneData& data) {
  const std::vector<std::uint32_t> largest = largest_joints(data);
  for (std::size_t i = 0; i < data.instances.size(); ++i) {
    const InstanceData& instance = data.instances[i];
    const auto wrong = [&](const char* message, const char* member) {
      return invalid(message, "/instances/" + std::to_string(i) + member);
    };
    if (instance.node != kInvalidId && instance.node >= data.nodes.size())
      return wrong("the instance names a node that does not exist", "/node");
    if (instance.entry != kInvalidId && instance.entry >= data.entries.size())
      return wrong("the instance names an entry that does not exist", "/entry");
    if (instance.skin_id == kInvalidId) continue;
    if (instance.skin_id >= data.skins.size())
      return wrong("the instance names a skin that does not exist", "/skin_id");
    const std::uint32_t joint = largest[instance.mesh_id];
    if (joint != kInvalidId && joint >= data.skins[instance.skin_id].joints.size())
      return wrong("the mesh names a joint that the skin does not have", "/skin_id");
  }
  return ok_status();
}

bool has_right_values(const AnimationChannel& channel) {
  const std::size_t rows = channel.interpolation == Interpolation::kCubicSpline ? 3 : 1;
  const std::size_t keys = channel.times_s.size();
  if (channel.values.size() != rows * keys * component_count(channel)) return false;
  if (keys == 0 || channel.path == AnimationPath::kWeights) return true;
  return component_count(channel) == (channel.path == AnimationPath::kRotation ? 4U : 3U);
}

Status check_animations(const SceneData& data) {
  for (std::size_t a = 0; a < data.animations.size(); ++a) {
    const auto& channels = data.animations[a].channels;
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const std::string where = "/animations/" + std::to_string(a) + "/channels/" + std::to_string(c);
      if (channels[c].node >= data.nodes.size())
        return invalid("the channel names a node that does not exist", where + "/node");
      if (!has_right_values(channels[c]))
        return invalid("the channel has another number of values than its key times need", where + "/values");
    }
  }
  return ok_status();
}

}  // namespace

Status check_rig(const SceneData& data) {
  for (const auto check : {check_nodes, check_skins, check_deformations, check_instances, check_animations})
    if (Status status = check(data); !status) return status;
  return ok_status();
}

}  // namespace gridcast::scene
