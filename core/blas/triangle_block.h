#pragma once

#include <cstdint>
#include <vector>

#include "core/math/uninitialized_allocator.h"
#include "core/math/vec.h"

namespace gridcast::blas {

/// Four triangles as columns, so that one load gives a coordinate of all four. A block that is not full
/// repeats its last triangle: testing one twice changes nothing.
struct alignas(32) TriangleBlock {
  float corners[3][3][4];  ///< [corner][axis][lane]
  std::uint32_t ids[4];

  [[nodiscard]] Vec3f corner(int number, std::size_t lane) const {
    return {corners[number][0][lane], corners[number][1][lane], corners[number][2][lane]};
  }
};
static_assert(sizeof(TriangleBlock) == 160);

/// Hit::corners_at of lane `lane` of block `block`.
inline std::uint32_t corners_at(std::size_t block, std::size_t lane) {
  return std::uint32_t(4 * block + lane);
}

using TriangleBlocks = std::vector<TriangleBlock, UninitializedAllocator<TriangleBlock>>;

}  // namespace gridcast::blas
