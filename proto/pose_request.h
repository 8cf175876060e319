#pragma once
// The bodies of PUT .../pose and PUT .../meshes/{m}/weights.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/math/affine.h"
#include "proto/json_reader.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/query.h"

namespace gridcast::proto {

/// An animation, skin or node of the scene's file: `animation_id`, its index there, or `animation`, its name.
using FileElement = std::variant<std::uint32_t, std::string>;

struct PoseAnimation {
  FileElement animation;
  double time_s = 0.0;
  std::string wrap = "clamp";  ///< one of kWrapNames
};
/// parent_from_node as rows (see scene_request.h), or the parts that are to change.
struct PoseNode {
  FileElement node;
  std::optional<Affine> transform;
  std::optional<Vec3d> translation;
  std::optional<std::array<double, 4>> rotation;  ///< quaternion x, y, z, w
  std::optional<Vec3d> scale;
};
struct PoseSkin {
  FileElement skin;
  std::vector<Affine> joint_matrices;  ///< world_from_mesh of every joint, as rows
};
struct PoseWeights {
  std::uint32_t mesh_id = kInvalidId;
  std::vector<double> weights;
};

/// {"base"?: "rest"|"present", "animation" or "animation_id"?, "time_s"?, "wrap"?: "clamp"|"loop",
///  "nodes"?: [{"node" or "node_id", "transform" or parts of "translation", "rotation", "scale"}],
///  "skins"?: [{"skin" or "skin_id", "joint_matrices"}], "weights"?: [{"mesh_id", "weights"}], "update"?}
struct PoseRequest {
  std::string base = "rest";  ///< one of kPoseBaseNames
  std::optional<PoseAnimation> animation;
  std::vector<PoseNode> nodes;
  std::vector<PoseSkin> skins;
  std::vector<PoseWeights> weights;
  std::string update = "auto";  ///< one of kUpdateModeNames
};

/// `?update=` wins over the body's. Whether names, ids and counts fit the scene is core's to say.
[[nodiscard]] Parsed<PoseRequest> parse_pose_request(std::string_view body, const QueryParameters& query,
                                                     const Limits& limits);

/// {"weights": [...], "update"?} as the pose that changes these alone.
[[nodiscard]] Parsed<PoseRequest> parse_weights_request(std::uint32_t mesh_id, std::string_view body,
                                                        const QueryParameters& query, const Limits& limits);

/// The members of a pose or of weights ({"mesh_id", "weights", "update"?}) inside of an edit, whose `op`
/// stands beside them.
[[nodiscard]] PoseRequest read_pose_edit(const JsonNode& node, const Limits& limits);
[[nodiscard]] PoseRequest read_weights_edit(const JsonNode& node);

}  // namespace gridcast::proto
