#pragma once
// Pieces shared by the writers of small replies; not for users of proto.

#include <nlohmann/json.hpp>

#include "core/math/affine.h"
#include "proto/error_table.h"
#include "proto/limits.h"
#include "proto/pose_reply.h"

namespace gridcast::proto {

[[nodiscard]] nlohmann::ordered_json limits_json(const Limits& limits);
[[nodiscard]] nlohmann::ordered_json problem_json(const Problem& problem);
[[nodiscard]] nlohmann::ordered_json posed_mesh_json(const PosedMesh& mesh);
/// Three rows of four: see scene_request.h.
[[nodiscard]] nlohmann::ordered_json transform_json(const Affine& transform);
/// Names come from files: bytes that are not UTF-8 are replaced rather than thrown at the client.
[[nodiscard]] std::string dump_json(const nlohmann::ordered_json& json);

}  // namespace gridcast::proto
