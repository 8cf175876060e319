#pragma once
// POST .../transactions: edits of one scene in one version, all or none.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/pose_reply.h"
#include "proto/pose_request.h"
#include "proto/scene_request.h"
#include "proto/vertex_request.h"

namespace gridcast::proto {

struct RemoveInstanceRequest {
  std::uint32_t instance_id = kInvalidId;
};
struct MeshVerticesRequest {
  std::uint32_t mesh_id = kInvalidId;
  VertexRequest vertices;
};
/// `op` is set_pose or set_weights.
struct PoseEditRequest {
  std::string op;
  PoseRequest pose;
};
using TransactionEdit = std::variant<AddInstanceRequest, InstanceMove, RemoveInstanceRequest,
                                     MeshVerticesRequest, PoseEditRequest, InstanceChange>;

/// {"edits": [{"op": "add_instance", "mesh_id", "transform"?, "name"?, "mask"?},
///            {"op": "move_instance", "instance_id", "transform"},
///            {"op": "change_instance", "instance_id", "transform"?, "mask"?, "name"?},
///            {"op": "remove_instance", "instance_id"},
///            {"op": "replace_vertices", "mesh_id", "positions", "vertex_ids"?, "update"?},
///            {"op": "set_pose", members of a PoseRequest},
///            {"op": "set_weights", "mesh_id", "weights", "update"?}, ...]}
/// in the order in which they are applied; at least one, at most limits.transaction_edits, of which
/// limits.transaction_poses poses. Whether ids exist is core's to say. Pointers of problems start with
/// `/edits/INDEX`.
[[nodiscard]] Parsed<std::vector<TransactionEdit>> parse_transaction(std::string_view body,
                                                                     const Limits& limits);

/// What became of one edit.
struct EditReply {
  std::string op;
  std::optional<std::uint32_t> instance_id;
  std::optional<std::uint32_t> mesh_id;
  struct Vertices {
    std::string action;  ///< refit, rebuild
    std::string reason;
    double cost_before = 0.0;
    double cost_after = 0.0;
  };
  std::optional<Vertices> vertices;  ///< of replace_vertices
  struct Pose {
    std::size_t moved_instances = 0;
    std::vector<PosedMesh> meshes;  ///< that changed
  };
  std::optional<Pose> pose;  ///< of set_pose and set_weights
};
struct TransactionReply {
  std::uint64_t scene_version = 0;
  std::vector<EditReply> edits;  ///< in the order of the request
  double ms = 0.0;
};
[[nodiscard]] std::string to_json(const TransactionReply& reply);

}  // namespace gridcast::proto
