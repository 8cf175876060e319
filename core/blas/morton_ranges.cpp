#include "core/blas/morton_ranges.h"

#include <algorithm>
#include <bit>

#include <oneapi/tbb/parallel_for.h>

namespace gridcast::blas {
namespace {

/// Keys are cut into ranges of at most this many, which are cut further in parallel.
constexpr std::uint32_t kTaskKeys = 4096;
/// So few keys are looked at one after the other: no branch to guess.
constexpr std::size_t kCountedKeys = 64;

/// As deep as codes have bits, and halves below.
void cut(std::span<const MortonKey> keys, const KeyRange& range, std::uint32_t largest,
         std::vector<KeyRange>& out) {
  if (range.size() <= largest) return out.push_back(range);
  const std::uint32_t middle =
      range.begin + std::uint32_t(morton_split(keys.subspan(range.begin, range.size())));
  cut(keys, {range.begin, middle}, largest, out);
  cut(keys, {middle, range.end}, largest, out);
}

}  // namespace

std::size_t morton_split(std::span<const MortonKey> keys) {
  const std::uint64_t differing = morton_code(keys.front() ^ keys.back());
  if (differing == 0) return keys.size() / 2;
  const int bit = int(std::bit_width(differing)) - 1 + kMortonNumberBits;
  if (keys.size() <= kCountedKeys) {
    std::uint64_t ones = 0;
    for (const MortonKey key : keys) ones += (key >> bit) & 1;
    return keys.size() - ones;
  }
  const auto place = std::partition_point(keys.begin(), keys.end(),
                                          [bit](MortonKey key) { return ((key >> bit) & 1) == 0; });
  return std::size_t(place - keys.begin());
}

std::vector<KeyRange> morton_ranges(std::span<const MortonKey> keys, std::uint32_t largest) {
  std::vector<KeyRange> tasks;
  if (!keys.empty()) cut(keys, {0, std::uint32_t(keys.size())}, std::max(largest, kTaskKeys), tasks);
  std::vector<std::vector<KeyRange>> ranges_of(tasks.size());
  oneapi::tbb::parallel_for(std::size_t(0), tasks.size(),
                            [&](std::size_t i) { cut(keys, tasks[i], largest, ranges_of[i]); });
  std::vector<KeyRange> all;
  for (const auto& ranges : ranges_of) all.insert(all.end(), ranges.begin(), ranges.end());
  return all;
}

}  // namespace gridcast::blas
