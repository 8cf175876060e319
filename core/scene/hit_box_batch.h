#pragma once

#include <array>

#include "core/math/transform_batch.h"
#include "core/scene/mesh_hull.h"
#include "core/tlas/instance_box.h"

namespace gridcast::scene {

/// The hull of the mesh of each lane.
using HullLanes = std::array<const MeshHull*, TransformBatch::kSize>;

/// The boxes of eight instances.
struct alignas(64) BoxLanes {
  TransformBatch::VectorLanes lower, upper;
  TransformBatch::Lanes drift;

  [[nodiscard]] tlas::InstanceBox box(std::size_t lane) const {
    return {
        {{lower[0][lane], lower[1][lane], lower[2][lane]}, {upper[0][lane], upper[1][lane], upper[2][lane]}},
        float(drift[lane])};
  }
};

/// hit_box() of eight instances at once, bit for bit. No pointer is null; what is said of an inactive lane or
/// an empty hull means nothing.
void hit_boxes(const TransformBatch& transforms, const HullLanes& hulls, BoxLanes& boxes);

}  // namespace gridcast::scene
