#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace gridcast::measure {

/// Times of one contender, one per repetition.
using Samples = std::vector<double>;

/// 0 for none.
[[nodiscard]] double median(Samples samples);
/// The sample that the share `q` in [0, 1] of them does not exceed, between two by their distances. 0 for
/// none.
[[nodiscard]] double quantile(Samples samples, double q);
/// How far samples differ: the distance of the quartiles by the median. 0 for fewer than two.
[[nodiscard]] double spread(Samples samples);
/// The median of theirs[i] / ours[i]: how many times faster ours is, taken repetition by repetition, so that
/// a machine that slows down meanwhile changes nothing. 0 when a series is missing.
[[nodiscard]] double speedup(const Samples& ours_s, const Samples& theirs_s);

/// kThread: time that the calling thread was running, the system's work for it included. What others do on a
/// shared machine then counts only by what they take from caches. For work on one thread; else kWall.
/// kProcess: the same of all threads together.
enum class ClockKind : std::uint8_t { kWall, kThread, kProcess };
[[nodiscard]] constexpr ClockKind clock_for(std::size_t threads) {
  return threads == 1 ? ClockKind::kThread : ClockKind::kWall;
}
/// Seconds since some moment.
[[nodiscard]] double now_s(ClockKind clock);

/// Seconds that `work()` takes.
template <class Work>
double seconds(ClockKind clock, const Work& work) {
  const double begin = now_s(clock);
  work();
  return now_s(clock) - begin;
}

}  // namespace gridcast::measure
