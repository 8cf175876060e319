#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <stop_token>

#include <tbb/parallel_for.h>

#include "core/scene/scene.h"

namespace gridcast::scene {

/// Calls work(i, block) for every i in [0, count), in parallel by blocks of `per_block`, in order within a
/// block. `work` returns false to end the whole loop. False when it was ended or stopped.
template <class Work>
bool for_each_in_blocks(std::size_t count, std::size_t per_block, const std::stop_token& stop,
                        const ProgressCallback& progress, const Work& work) {
  std::atomic<bool> ended = false;
  std::atomic<std::size_t> done = 0;
  const std::size_t blocks = (count + per_block - 1) / per_block;
  tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t block) {
    const std::size_t begin = block * per_block, end = std::min(count, begin + per_block);
    for (std::size_t i = begin; i < end; ++i) {
      if (ended.load(std::memory_order_relaxed)) return;
      if (stop.stop_requested() || !work(i, block)) ended = true;
    }
    const std::size_t now = done += end - begin;
    if (progress) progress(double(now) / double(count));
  });
  return !ended;
}

}  // namespace gridcast::scene
