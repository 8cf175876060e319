#pragma once
// A single step of the walk through the grid, with the instructions that the walk uses now: for explaining it
// with the same decisions. Defined beside the walk, which does not call it.

#include <cstdint>

#include "core/tlas/box_group.h"
#include "core/tlas/grid_ray.h"

namespace gridcast::tlas {

struct alignas(32) GroupEntries {
  float s_enter[8];  ///< of each slot; see GridRay
};

/// Slab test of a group's slots up to t = far; returns a bit per slot that may be hit.
[[nodiscard]] std::uint32_t enter_group(const BoxGroup<4>& group, const GridRay& ray, double far,
                                        GroupEntries& entries);
[[nodiscard]] std::uint32_t enter_group(const BoxGroup<8>& group, const GridRay& ray, double far,
                                        GroupEntries& entries);

}  // namespace gridcast::tlas
