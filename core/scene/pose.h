#pragma once
// How the nodes, skins and morph targets of a scene stand, and what that makes of its instances and meshes.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "core/mesh/deform.h"
#include "core/scene/rig.h"

namespace gridcast::scene {

/// One entry per SceneData::nodes in each.
struct NodePoses {
  std::vector<Affine> locals;  ///< parent_from_node
  std::vector<Trs> parts;      ///< the same, as animations change it part by part
  std::vector<Affine> worlds;  ///< world_from_node
};

/// Of which animation, and of which moment of it after looping or clamping.
struct AnimationMoment {
  std::uint32_t animation_id = kInvalidId;
  double time_s = 0.0;
};

struct Pose {
  std::shared_ptr<const NodePoses> nodes;                ///< shared by poses that differ elsewhere
  std::map<std::uint32_t, std::vector<double>> weights;  ///< of every mesh with morph targets, one per target
  /// Of skins that were given joint matrices: world_from_mesh of every joint. The others follow their nodes.
  std::map<std::uint32_t, std::vector<Affine>> joints;
  std::optional<AnimationMoment> animation;  ///< the last that was applied; more may have changed since
};

[[nodiscard]] Pose rest_pose(const SceneData& data, const Rig& rig);

/// Makes `worlds` from `locals`.
void place_nodes(const SceneData& data, NodePoses& nodes);

/// Where the object space of a skinned mesh is in the world: at the place of the node above its joints,
/// without turning. (The spec asks for no more than that the mesh's own node does not matter. A character
/// that stands a thousand kilometres out then still has small coordinates in float, and its instance carries
/// the distance in double.)
[[nodiscard]] Affine skin_frame(const Rig& rig, std::uint32_t skin_id, const NodePoses& nodes);

/// For every joint of the skin, from the mesh at rest to the object space of skin_frame: glTF's joint
/// matrices (world of the joint times inverse bind matrix) as seen from there.
[[nodiscard]] std::vector<Affine> joint_matrices(const SceneData& data, const Rig& rig, const Pose& pose,
                                                 std::uint32_t skin_id);

/// Where an instance of the file stands: with its node, or where its skin is. None for one without a node.
[[nodiscard]] std::optional<Affine> place_of(const SceneData& data, const Rig& rig, const NodePoses& nodes,
                                             std::uint32_t instance_id);

/// The vertices of a mesh of the rig that deforms; `joints` are those of its skin, empty without one.
[[nodiscard]] mesh::DeformedVertices posed_vertices(const SceneData& data, const Rig& rig, const Pose& pose,
                                                    std::uint32_t mesh_id, const std::vector<Affine>& joints);

[[nodiscard]] std::size_t memory_bytes(const Pose& pose);

}  // namespace gridcast::scene
