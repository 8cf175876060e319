#pragma once
// Where the triangles of a file's rest pose are in the world, from the text of glTF 2.0 in long double.
// Shares no code with core/scene/pose.cpp and core/mesh/deform.cpp.

#include <array>
#include <vector>

#include "core/scene/scene_data.h"

namespace gridcast::test {

using WidePoint = std::array<long double, 3>;

/// World positions of every vertex of an instance at rest: morphed by its node's weights or the mesh's, then
/// moved by its joints, or by its own transform when it has no skin.
std::vector<WidePoint> reference_rest(const scene::SceneData& data, std::size_t instance_id);

}  // namespace gridcast::test
