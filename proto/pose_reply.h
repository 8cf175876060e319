#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/math/affine.h"

namespace gridcast::proto {

/// What became of a mesh that deforms.
struct PosedMesh {
  std::uint32_t mesh_id = 0;
  std::string action;  ///< none, refit, rebuild
  std::string reason;
  double cost_before = 0.0;
  double cost_after = 0.0;
  double ms = 0.0;
};

/// Of which animation the pose is, and of what time of it after clamping or looping.
struct PlayedAnimation {
  std::uint32_t animation_id = 0;
  std::string name;
  double time_s = 0.0;
};

/// PUT pose.
struct PoseReply {
  std::uint64_t scene_version = 0;
  std::optional<PlayedAnimation> animation;
  std::size_t moved_instances = 0;
  std::size_t inactive_instances = 0;  ///< of these, squeezed to nothing
  std::vector<PosedMesh> meshes;       ///< every mesh that deforms
  double ms = 0.0;
};

/// PUT weights.
struct WeightsReply {
  std::uint64_t scene_version = 0;
  PosedMesh mesh;
};

/// GET weights.
struct WeightsInfo {
  std::uint64_t scene_version = 0;
  std::uint32_t mesh_id = 0;
  std::vector<double> weights;
};

/// GET pose: a page of the nodes, and all that is not the nodes'. PUT takes the same members.
struct PoseInfo {
  std::uint64_t scene_version = 0;
  std::optional<PlayedAnimation> animation;
  struct Node {
    std::uint32_t node_id = 0;
    std::string name;
    std::optional<std::uint32_t> parent_id;
    Affine parent_from_node;
  };
  std::size_t node_count = 0;
  std::vector<Node> nodes;
  std::optional<std::size_t> next_offset;  ///< of the next page; none at the end
  struct Skin {
    std::uint32_t skin_id = 0;
    std::vector<Affine> joint_matrices;
  };
  std::vector<Skin> skins;  ///< that were given joint matrices
  struct Weights {
    std::uint32_t mesh_id = 0;
    std::vector<double> weights;
  };
  std::vector<Weights> weights;  ///< of every mesh with morph targets
};

[[nodiscard]] std::string to_json(const PoseReply& reply);
[[nodiscard]] std::string to_json(const WeightsReply& reply);
[[nodiscard]] std::string to_json(const WeightsInfo& info);
[[nodiscard]] std::string to_json(const PoseInfo& info);

}  // namespace gridcast::proto
