#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/triangle_mesh.h"

namespace gridcast::mesh {

/// For every vertex the smallest index of a vertex at exactly the same position (0 and -0 are the same).
/// O(n log n) whatever the positions are.
[[nodiscard]] std::vector<std::uint32_t> weld_vertices(const TriangleMesh& mesh);

}  // namespace gridcast::mesh
