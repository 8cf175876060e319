#pragma once
// Which meshes of a scene deform, by which skin, and which nodes move what: worked out once, when it is
// built.

#include <cstdint>
#include <map>
#include <unordered_map>
#include <vector>

#include "core/scene/scene_data.h"

namespace gridcast::scene {

/// A mesh of the scene, made from one of the file. Its mesh_id is its index in Rig::meshes.
struct RigMesh {
  std::uint32_t source_mesh = kInvalidId;  ///< index into SceneData::meshes
  std::uint32_t skin_id = kInvalidId;      ///< the skin that it follows; none = not skinned
  std::vector<float> weights;              ///< at rest, one per morph target
  bool deforms = false;                    ///< has morph targets or follows a skin
};

/// Meshes keep the file's ids. Where instances of one mesh have other skins, other weights or weights
/// animated by another node, the first by instance_id keeps the mesh and each further kind gets a copy of its
/// own, numbered after the meshes of the file in the order of the instances.
struct Rig {
  std::vector<RigMesh> meshes;
  std::vector<std::uint32_t> mesh_of_instance;          ///< mesh_id of each instance of the file
  std::map<std::uint32_t, std::uint32_t> mesh_of_node;  ///< of nodes whose weights an animation changes
  /// For each skin, the node above its joints: the closest ancestor of the first joint that is no joint
  /// itself.
  std::vector<std::uint32_t> skin_root;
  std::unordered_map<std::uint32_t, std::uint32_t> node_of_id;  ///< index into SceneData::nodes by node_id
};

/// The id by which clients know a node: its index in the file, or in SceneData::nodes without a file.
[[nodiscard]] std::uint32_t node_id(const SceneData& data, std::uint32_t node);

/// `data` has passed check_rig.
[[nodiscard]] Rig make_rig(const SceneData& data);

/// What make_rig and poses rely on: parents before children, indices in range, deformations that fit their
/// meshes, joints that the skins of their instances have, as many key values as key times. The error names
/// the first offending place (`/skins/0/joints`).
[[nodiscard]] Status check_rig(const SceneData& data);

}  // namespace gridcast::scene
