#pragma once
// Where the triangles of a file's poses are in the world, from the text of glTF 2.0 in long double.
// Shares no code with core/scene/pose.cpp, core/scene/animation.cpp and core/mesh/deform.cpp.

#include <array>
#include <vector>

#include "core/scene/scene_data.h"

namespace gridcast::test {

using WidePoint = std::array<long double, 3>;

/// Row-major 3 x 4.
struct WideMatrix {
  std::array<std::array<long double, 4>, 3> rows{};
};

/// One entry per node in each.
struct ReferencePose {
  std::vector<WideMatrix> locals;
  std::vector<std::vector<double>> weights;  ///< empty = those of the mesh
};

ReferencePose reference_rest_pose(const scene::SceneData& data);
/// The rest pose with one animation's channels at a time, as appendix C has them.
ReferencePose reference_animated(const scene::SceneData& data, std::size_t animation_id, long double time_s);

/// World positions of every vertex of an instance: morphed by its node's weights or the mesh's, then moved by
/// its joints, or by its own transform when it has no skin.
std::vector<WidePoint> reference_points(const scene::SceneData& data, const ReferencePose& pose,
                                        std::size_t instance_id);

/// The same at rest.
std::vector<WidePoint> reference_rest(const scene::SceneData& data, std::size_t instance_id);

}  // namespace gridcast::test
