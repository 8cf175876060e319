#pragma once

#include <chrono>
#include <vector>

namespace gridcast::measure {

/// Times of one contender, one per repetition.
using Samples = std::vector<double>;

/// 0 for none.
[[nodiscard]] double median(Samples samples);
/// How far samples differ: the distance of the quartiles by the median. 0 for fewer than two.
[[nodiscard]] double spread(Samples samples);
/// The median of theirs[i] / ours[i]: how many times faster ours is, taken repetition by repetition, so that
/// a machine that slows down meanwhile changes nothing. 0 when a series is missing.
[[nodiscard]] double speedup(const Samples& ours_s, const Samples& theirs_s);

/// Seconds that `work()` takes.
template <class Work>
double seconds(const Work& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace gridcast::measure
