#pragma once
// How work on some of the slots of a scene is shared among threads.

#include <algorithm>
#include <cstddef>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/tlas/instance_box.h"

namespace gridcast::scene {

/// Slots in a row that only one task writes: a chunk of the boxes, which is several of the instances.
inline constexpr std::size_t kSlotsOfOneTask = tlas::BoxTable::kChunkSize;

/// Where parts of 0 .. count - 1 begin, and count. id_of(k) ascends, and no two parts have ids in one chunk,
/// so that each may write what is stored under its ids.
template <class IdOf>
[[nodiscard]] std::vector<std::size_t> part_borders(std::size_t count, const IdOf& id_of) {
  constexpr std::size_t kIdsPerPart = 512;
  std::vector<std::size_t> borders;
  borders.reserve(count / kIdsPerPart + 2);
  for (std::size_t k = 0; k < count; k = std::max(k + 1, borders.size() * kIdsPerPart)) {
    while (k > 0 && k < count && id_of(k) / kSlotsOfOneTask == id_of(k - 1) / kSlotsOfOneTask) ++k;
    if (k < count) borders.push_back(k);
  }
  borders.push_back(count);
  return borders;
}

/// Calls work(begin, end) for the parts between the borders, in parallel.
template <class Work>
void for_each_part(const std::vector<std::size_t>& borders, const Work& work) {
  tbb::parallel_for(std::size_t(1), borders.size(),
                    [&](std::size_t part) { work(borders[part - 1], borders[part]); });
}

}  // namespace gridcast::scene
