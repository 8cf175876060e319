#pragma once
// How much of a wide tree rays look at, counted; the surface-area cost (wide_cost.h) estimates it.

#include <cstddef>
#include <cstdint>
#include <stop_token>

#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

/// What a ray looked at on its way to its closest hit: the eight boxes of a node are one step, the four
/// triangles of a block another.
struct WideSteps {
  std::uint32_t nodes = 0;
  std::uint32_t blocks = 0;
};

/// The way of a ray of precision `fast` in the order of WideBvh::intersect, one box and one triangle at a
/// time. `best` starts as {tfar} and is left as that leaves it.
[[nodiscard]] WideSteps steps_to_closest(const WideNodes& nodes, const TriangleBlocks& blocks,
                                         const mesh::ObjectRay& ray, Hit& best);

/// Nodes and blocks that a ray looks at, the mean of `rays` of them through `bounds`, the mesh's box. The
/// rays lie in all boxes alike, so that two moments of a mesh compare. 0 where no ray can be sent: none asked
/// for, an empty mesh, or all of it in one point. kCancelled on `stop`.
[[nodiscard]] Result<double> steps_per_ray(const WideNodes& nodes, const TriangleBlocks& blocks,
                                           const Bounds3f& bounds, std::size_t rays,
                                           const std::stop_token& stop = {});

}  // namespace gridcast::blas
