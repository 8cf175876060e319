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
using TransactionEdit =
    std::variant<AddInstanceRequest, InstanceMove, RemoveInstanceRequest, MeshVerticesRequest>;

/// {"edits": [{"op": "add_instance", "mesh_id", "transform"?, "name"?},
///            {"op": "move_instance", "instance_id", "transform"},
///            {"op": "remove_instance", "instance_id"},
///            {"op": "replace_vertices", "mesh_id", "positions", "vertex_ids"?, "update"?}, ...]}
/// in the order in which they are applied; at least one, at most limits.transaction_edits. Whether ids exist
/// is core's to say. Pointers of problems start with `/edits/INDEX`.
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
};
struct TransactionReply {
  std::uint64_t scene_version = 0;
  std::vector<EditReply> edits;  ///< in the order of the request
  double ms = 0.0;
};
[[nodiscard]] std::string to_json(const TransactionReply& reply);

}  // namespace gridcast::proto
