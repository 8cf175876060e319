#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/blas/build_reference.h"
#include "core/blas/uninitialized_allocator.h"

namespace gridcast::blas {

/// Where a reference lies along a Morton curve.
struct MortonKey {
  std::uint64_t code;       ///< 21 bits an axis, the highest bits first: x y z x y z ...
  std::uint32_t reference;  ///< its place among the references given
};
inline constexpr int kMortonBits = 63;

using MortonKeys = std::vector<MortonKey, UninitializedAllocator<MortonKey>>;

/// The references in ascending order of (code of the center, place), in parallel. `centers` are the bounds of
/// their doubled centers. Cells are cubes: the longest side of `centers` has 2^21. The result does not depend
/// on the number of threads.
[[nodiscard]] MortonKeys morton_order(std::span<const BuildReference> references, const Box4& centers);

}  // namespace gridcast::blas
