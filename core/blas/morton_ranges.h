#pragma once

#include <cstdint>
#include <vector>

#include "core/blas/morton_order.h"

namespace gridcast::blas {

/// [begin, end) of sorted keys.
struct KeyRange {
  std::uint32_t begin, end;
  [[nodiscard]] std::uint32_t size() const { return end - begin; }
};

/// How many of the ascending keys come before the highest bit turns to one in which their codes differ; half
/// where no bit does. Neither none nor all, of two keys or more.
[[nodiscard]] std::size_t morton_split(std::span<const MortonKey> keys);

/// All keys, split until no range is longer than `largest`; in their order, in parallel.
[[nodiscard]] std::vector<KeyRange> morton_ranges(std::span<const MortonKey> keys, std::uint32_t largest);

}  // namespace gridcast::blas
