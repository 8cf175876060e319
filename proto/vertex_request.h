#pragma once
// The body of PATCH .../meshes/{m}/vertices.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/vec.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/query.h"

namespace gridcast::proto {

/// Object-space positions, finite after narrowing to float. With `vertex_ids` empty they replace every
/// vertex, otherwise position k goes to vertex vertex_ids[k]. Whether counts and ids fit the mesh is core's
/// to say.
struct VertexRequest {
  std::vector<Vec3f> positions;
  std::vector<std::uint32_t> vertex_ids;
  std::string update = "auto";  ///< one of kUpdateModeNames
};

/// JSON {"positions": [[x,y,z]...], "vertex_ids": [...]?, "update"?} or binary
/// (application/vnd.gridcast.vertices; layout=whole|sparse), little-endian: whole = float32 [N, 3]; sparse =
/// uint32 [K] ids, then float32 [K, 3]. `?update=` wins over the body's.
[[nodiscard]] Parsed<VertexRequest> parse_vertex_request(std::string_view content_type, std::string_view body,
                                                         const QueryParameters& query, const Limits& limits);

}  // namespace gridcast::proto
