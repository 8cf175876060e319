#pragma once

#include "core/mesh/triangle_mesh.h"

namespace gridcast::blas {

/// How many boxes of triangles a random ray meets that meets `bounds`, the mesh's box: half the area of them
/// all by that of the whole (cost_model.h). From evenly spaced triangles, always the same of a mesh, so that
/// two moments of it compare. Some n^(1/3) or less where small triangles lie side by side, a share of all n
/// where triangles are as large as the mesh. 0 where there is nothing to divide by.
[[nodiscard]] double triangle_boxes_per_ray(const mesh::TriangleMesh& mesh, const Bounds3f& bounds);

}  // namespace gridcast::blas
