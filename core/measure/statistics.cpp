#include "core/measure/statistics.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <utility>

namespace gridcast::measure {
namespace {

/// Linear interpolation between the sorted samples.
double within_sorted(const Samples& sorted, double q) {
  const double at = q * double(sorted.size() - 1);
  const auto below = std::size_t(std::floor(at));
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - double(below)) * (sorted[above] - sorted[below]);
}

}  // namespace

double quantile(Samples samples, double q) {
  if (samples.empty()) return 0.0;
  std::sort(samples.begin(), samples.end());
  return within_sorted(samples, q);
}

double median(Samples samples) {
  return quantile(std::move(samples), 0.5);
}

double spread(Samples samples) {
  if (samples.size() < 2) return 0.0;
  std::sort(samples.begin(), samples.end());
  const double middle = within_sorted(samples, 0.5);
  return middle > 0.0 ? (within_sorted(samples, 0.75) - within_sorted(samples, 0.25)) / middle : 0.0;
}

double now_s(ClockKind clock) {
  if (clock != ClockKind::kWall) {
    timespec now{};
    ::clock_gettime(clock == ClockKind::kThread ? CLOCK_THREAD_CPUTIME_ID : CLOCK_PROCESS_CPUTIME_ID, &now);
    return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double speedup(const Samples& ours_s, const Samples& theirs_s) {
  Samples ratios;
  for (std::size_t i = 0; i < std::min(ours_s.size(), theirs_s.size()); ++i)
    if (ours_s[i] > 0.0) ratios.push_back(theirs_s[i] / ours_s[i]);
  return median(std::move(ratios));
}

}  // namespace gridcast::measure
