#pragma once
// Where the nodes of a scene stand, and what that makes of its deforming meshes.

#include <cstdint>
#include <vector>

#include "core/mesh/deform.h"
#include "core/scene/rig.h"

namespace gridcast::scene {

/// World transforms of the nodes, one per SceneData::nodes.
[[nodiscard]] std::vector<Affine> rest_worlds(const SceneData& data);

/// Where the object space of a skinned mesh is in the world: at the place of the node above its joints,
/// without turning. (The spec asks for no more than that the mesh's own node does not matter. A character
/// that stands a thousand kilometres out then still has small coordinates in float, and its instance carries
/// the distance in double.)
[[nodiscard]] Affine skin_frame(const Rig& rig, std::uint32_t skin_id, const std::vector<Affine>& worlds);

/// For every joint of the skin, from the mesh at rest to the object space of skin_frame: glTF's joint
/// matrices (world of the joint times inverse bind matrix) as seen from there.
[[nodiscard]] std::vector<Affine> joint_matrices(const SceneData& data, const Rig& rig, std::uint32_t skin_id,
                                                 const std::vector<Affine>& worlds);

/// The vertices of a mesh of the rig that deforms; `weights` has one entry per morph target.
[[nodiscard]] mesh::DeformedVertices posed_vertices(const SceneData& data, const Rig& rig,
                                                    std::uint32_t mesh_id, const std::vector<float>& weights,
                                                    const std::vector<Affine>& worlds);

}  // namespace gridcast::scene
