#pragma once
// The answer of GET .../meshes/{m}/vertices, in the forms that PATCH takes back.

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include "core/math/vec.h"

namespace gridcast::proto {

/// {"positions": [[x,y,z]...]}, the shortest text with the same floats; nothing when it would be longer than
/// `max_bytes`.
[[nodiscard]] std::optional<std::string> write_vertices_json(std::span<const Vec3f> positions,
                                                             std::size_t max_bytes);
/// Little-endian float32 [N, 3]: layout=whole of application/vnd.gridcast.vertices.
[[nodiscard]] std::string write_vertices_binary(std::span<const Vec3f> positions);

}  // namespace gridcast::proto
