#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/blas/build_reference.h"
#include "core/math/uninitialized_allocator.h"

namespace gridcast::blas {

/// Where a primitive lies along a Morton curve, and which it is: the code of its cell above its number, so
/// that keys compare as numbers. 11 bits an axis, the highest first: x y z x y z ...
using MortonKey = std::uint64_t;
inline constexpr int kMortonAxisBits = 11;
inline constexpr int kMortonNumberBits = 31;
inline std::uint64_t morton_code(MortonKey key) {
  return key >> kMortonNumberBits;
}
inline std::uint32_t morton_number(MortonKey key) {
  return std::uint32_t(key) & ((1U << kMortonNumberBits) - 1);
}

using MortonKeys = std::vector<MortonKey, UninitializedAllocator<MortonKey>>;
/// Doubled centers; the fourth lanes are anything.
using Centers = std::vector<Float4, UninitializedAllocator<Float4>>;

/// Cells that hold more than this many are put in order inside; the others stay in the order of the numbers.
inline constexpr std::size_t kMaxUnorderedCell = 4;

/// Primitives in ascending order of their cells, in parallel: cubes, 2^11 along the longest side of `bounds`,
/// the bounds of the centers. Within a crowded cell they follow the same curve of 2^21 cubes, where it passes
/// them; all else is in the order of the numbers. The result does not depend on the number of threads.
[[nodiscard]] MortonKeys morton_order(std::span<const Float4> centers, const Box4& bounds);

}  // namespace gridcast::blas
