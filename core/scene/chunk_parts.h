#pragma once
// How work on some of the slots of a scene is shared among threads.

#include <algorithm>
#include <cstddef>

#include <tbb/parallel_for.h>

#include "core/tlas/instance_box.h"

namespace gridcast::scene {

/// Slots in a row that only one task writes: a chunk of the boxes, which is several of the instances.
inline constexpr std::size_t kSlotsOfOneTask = tlas::BoxTable::kChunkSize;

/// Calls work(begin, end) for parts of 0 .. count - 1 that cover it, in parallel. id_of(k) ascends, and no
/// two parts have ids in one chunk, so that each may write what is stored under its ids.
template <class IdOf, class Work>
void for_each_part(std::size_t count, const IdOf& id_of, const Work& work) {
  constexpr std::size_t kIdsPerPart = 512;
  const std::size_t parts = (count + kIdsPerPart - 1) / kIdsPerPart;
  const auto border = [&](std::size_t part) {
    std::size_t k = std::min(part * kIdsPerPart, count);
    while (k > 0 && k < count && id_of(k) / kSlotsOfOneTask == id_of(k - 1) / kSlotsOfOneTask) ++k;
    return k;
  };
  tbb::parallel_for(std::size_t(0), parts, [&](std::size_t part) {
    const std::size_t begin = border(part), end = border(part + 1);
    if (begin < end) work(begin, end);
  });
}

}  // namespace gridcast::scene
