#include "core/blas/bvh_split.h"

#include <algorithm>
#include <vector>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>

namespace gridcast::blas {
namespace {

/// Sets above this are scanned in parallel; below, starting tasks costs more than it saves.
constexpr std::size_t kParallelScan = 1 << 15;
constexpr std::size_t kScanGrain = 1 << 13;

/// Sets from here on are binned twice over, every second reference.
constexpr std::size_t kTwoSets = 192;

constexpr std::uint32_t kMaxBins = 16;
constexpr std::uint32_t kMinBins = 4;
/// A bin more for every so many references.
constexpr std::size_t kReferencesPerBin = 16;
/// Axes on which all centers lie closer are not binned: bins per length would overflow a float.
constexpr float kMinExtent = 0x1p-120F;

int longest_axis(const Box4& box) {
  const Float4 extent = box.extent();
  if (extent[0] >= extent[1]) return extent[0] >= extent[2] ? 0 : 2;
  return extent[1] >= extent[2] ? 1 : 2;
}

/// In-place partition that collects the bounds of both parts on the way.
template <class GoesFirst>
Division partition(std::span<BuildReference> references, GoesFirst goes_first) {
  Division result;
  std::size_t low = 0;
  std::size_t high = references.size();
  for (;;) {
    while (low < high && goes_first(references[low])) result.parts[0].extend(references[low++]);
    while (low < high && !goes_first(references[high - 1])) result.parts[1].extend(references[--high]);
    if (low == high) break;
    std::swap(references[low], references[high - 1]);
  }
  result.middle = low;
  return result;
}

/// Centers to bins, all three axes at once.
struct BinMap {
  Float4 origin;
  Float4 scale;
  Float4 last;

  BinMap(const Box4& centers, std::uint32_t bin_count)
      : origin(first_three(centers.lower)), scale(broadcast(0.F)), last(broadcast(float(bin_count - 1))) {
    const Float4 extent = centers.extent();
    for (int axis = 0; axis < 3; ++axis)
      if (usable(extent, axis)) scale[axis] = float(bin_count) / extent[axis];
  }
  static bool usable(Float4 extent, int axis) { return extent[axis] > kMinExtent; }
  [[nodiscard]] Int4 bins(const Box4& box) const {
    return __builtin_convertvector(min((doubled_center(box) - origin) * scale, last), Int4);
  }
};

struct BinSet {
  std::array<std::array<Box4, kMaxBins>, 3> boxes;
  std::array<std::array<std::uint32_t, kMaxBins>, 3> counts;

  explicit BinSet(std::uint32_t bin_count) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::fill_n(boxes[axis].begin(), bin_count, Box4{});
      std::fill_n(counts[axis].begin(), bin_count, 0U);
    }
  }
  void add(const BuildReference& reference, const BinMap& map) {
    const Box4 box = reference.box();
    const Int4 bins = map.bins(box);
    for (int axis = 0; axis < 3; ++axis) {
      const auto bin = std::size_t(bins[axis]);
      boxes[std::size_t(axis)][bin].extend(box);
      ++counts[std::size_t(axis)][bin];
    }
  }
  void merge(const BinSet& other, std::uint32_t bin_count) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < bin_count; ++i) {
        boxes[axis][i].extend(other.boxes[axis][i]);
        counts[axis][i] += other.counts[axis][i];
      }
    }
  }
};

/// Neighbours mostly fall into the same bins, and each would wait for the one before it: so where there are
/// many every second one goes to bins of its own.
void add_in_turns(std::span<const BuildReference> references, const BinMap& map, std::uint32_t bin_count,
                  BinSet& bins) {
  if (references.size() < kTwoSets) {
    for (const BuildReference& reference : references) bins.add(reference, map);
    return;
  }
  BinSet others(bin_count);
  for (std::size_t i = 0; i + 1 < references.size(); i += 2) {
    bins.add(references[i], map);
    others.add(references[i + 1], map);
  }
  if (references.size() % 2 != 0) bins.add(references.back(), map);
  bins.merge(others, bin_count);
}

/// Adds to `all`, which is empty.
void fill_bins(std::span<const BuildReference> references, const BinMap& map, std::uint32_t bin_count,
               BinSet& all) {
  if (references.size() < kParallelScan) return add_in_turns(references, map, bin_count, all);
  all = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, references.size(), kScanGrain), all,
      [&](const tbb::blocked_range<std::size_t>& range, BinSet bins) {
        add_in_turns(references.subspan(range.begin(), range.size()), map, bin_count, bins);
        return bins;
      },
      [bin_count](BinSet a, const BinSet& b) {
        a.merge(b, bin_count);
        return a;
      });
}

/// One axis swept from the right, then from the left: area times blocks on both sides of each plane.
class AxisSweep {
 public:
  AxisSweep(const std::array<Box4, kMaxBins>& boxes, const std::array<std::uint32_t, kMaxBins>& counts,
            std::uint32_t bin_count, const AreaScale& areas, LeafBlock block)
      : boxes_(boxes), counts_(counts), bin_count_(bin_count), areas_(areas), block_(std::uint32_t(block)) {}

  /// Lowers `least` and returns the first bin of the right part, or returns 0.
  [[nodiscard]] std::uint32_t cheapest(float& least) const {
    std::array<float, kMaxBins> right_cost;
    Box4 box;
    std::uint32_t count = 0;
    for (std::uint32_t i = bin_count_ - 1; i > 0; --i) {
      box.extend(boxes_[i]);
      count += counts_[i];
      right_cost[i] = count == 0 ? -1.F : cost(box, count);
    }
    std::uint32_t best = 0;
    box = {};
    count = 0;
    for (std::uint32_t i = 1; i < bin_count_; ++i) {
      box.extend(boxes_[i - 1]);
      count += counts_[i - 1];
      if (count == 0 || right_cost[i] < 0.F) continue;
      const float both = cost(box, count) + right_cost[i];
      if (both >= least) continue;
      least = both;
      best = i;
    }
    return best;
  }

 private:
  [[nodiscard]] float cost(const Box4& box, std::uint32_t count) const {
    const std::uint32_t blocks = (count + block_ - 1) / block_;
    return areas_.half_area(box) * float(blocks);
  }

  const std::array<Box4, kMaxBins>& boxes_;
  const std::array<std::uint32_t, kMaxBins>& counts_;
  std::uint32_t bin_count_;
  const AreaScale& areas_;
  std::uint32_t block_;
};

/// Copies [begin, end) of the references to two places, without branches. Returns the bounds of the centers.
std::array<Box4, 2> copy_parts(std::span<const BuildReference> references, const BinnedSplit& split,
                               BuildReference* left, BuildReference* right) {
  std::array<Box4, 2> centers;
  for (const BuildReference& reference : references) {
    const bool goes_right = split.goes_right(reference);
    *(goes_right ? right : left) = reference;
    right += goes_right ? 1 : 0;
    left += goes_right ? 0 : 1;
    // NaN in the lanes of the part that does not get it: minimum and maximum then keep what they had.
    const Int4 not_left = Int4{} - (goes_right ? 1 : 0);
    const auto center = Int4(doubled_center(reference.box()));
    centers[0].extend(Float4(center | not_left));
    centers[1].extend(Float4(center | ~not_left));
  }
  return centers;
}

/// Where each block's parts begin, counted first.
std::array<Box4, 2> copy_parts_in_parallel(std::span<const BuildReference> references,
                                           const BinnedSplit& split, BuildReference* left,
                                           BuildReference* right) {
  const std::size_t blocks = (references.size() + kScanGrain - 1) / kScanGrain;
  auto block = [&](std::size_t i) {
    return references.subspan(i * kScanGrain, std::min(kScanGrain, references.size() - i * kScanGrain));
  };
  std::vector<std::size_t> lefts_before(blocks + 1, 0);
  tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t i) {
    std::size_t lefts = 0;
    for (const BuildReference& reference : block(i)) lefts += split.goes_right(reference) ? 0 : 1;
    lefts_before[i + 1] = lefts;
  });
  for (std::size_t i = 0; i < blocks; ++i) lefts_before[i + 1] += lefts_before[i];
  std::vector<std::array<Box4, 2>> centers(blocks);
  tbb::parallel_for(std::size_t(0), blocks, [&](std::size_t i) {
    const std::size_t rights_before = i * kScanGrain - lefts_before[i];
    centers[i] = copy_parts(block(i), split, left + lefts_before[i], right + rights_before);
  });
  std::array<Box4, 2> all;
  for (const auto& parts : centers)
    for (std::size_t side = 0; side < 2; ++side) all[side].extend(parts[side]);
  return all;
}

std::uint32_t bins_for(std::size_t size) {
  return std::uint32_t(std::min<std::size_t>(kMinBins + size / kReferencesPerBin, kMaxBins));
}

}  // namespace

Division divide_at_median(std::span<BuildReference> references, const SetBounds& bounds) {
  const int axis = longest_axis(bounds.centers);
  Division result;
  result.middle = references.size() / 2;
  std::nth_element(references.begin(), references.begin() + std::ptrdiff_t(result.middle), references.end(),
                   [axis](const BuildReference& a, const BuildReference& b) {
                     const float ca = a.lower[axis] + a.upper[axis];
                     const float cb = b.lower[axis] + b.upper[axis];
                     return ca != cb ? ca < cb : a.id < b.id;
                   });
  result.parts[0] = bounds_of(references.first(result.middle));
  result.parts[1] = bounds_of(references.subspan(result.middle));
  return result;
}

std::optional<Division> divide_at_midpoint(std::span<BuildReference> references, const SetBounds& bounds) {
  const int axis = longest_axis(bounds.centers);
  const float middle = bounds.centers.bounds().center()[axis];
  // Every center is at or above the lower end; one lies on it, one on the upper end.
  if (!(middle > bounds.centers.lower[axis])) return std::nullopt;
  return partition(references, [axis, middle](const BuildReference& reference) {
    return reference.lower[axis] + reference.upper[axis] < middle;
  });
}

std::optional<BinnedSplit> find_binned_split(std::span<const BuildReference> references,
                                             const SetBounds& bounds, const AreaScale& areas,
                                             LeafBlock block) {
  const std::uint32_t bin_count = bins_for(references.size());
  const BinMap map(bounds.centers, bin_count);
  BinSet bins(bin_count);
  fill_bins(references, map, bin_count, bins);
  const Float4 extent = bounds.centers.extent();
  float least = std::numeric_limits<float>::infinity();
  std::uint32_t first_of_right = 0;
  std::size_t axis = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    if (!BinMap::usable(extent, int(a))) continue;
    const std::uint32_t found =
        AxisSweep(bins.boxes[a], bins.counts[a], bin_count, areas, block).cheapest(least);
    if (found == 0) continue;
    first_of_right = found;
    axis = a;
  }
  if (first_of_right == 0) return std::nullopt;
  BinnedSplit split;
  split.axis = int(axis);
  split.origin = map.origin[split.axis];
  split.scale = map.scale[split.axis];
  split.first_bin_of_right = float(first_of_right);
  split.cost = least;
  for (std::uint32_t i = 0; i < bin_count; ++i) {
    const std::size_t side = i < first_of_right ? 0 : 1;
    split.counts[side] += bins.counts[axis][i];
    split.boxes[side].extend(bins.boxes[axis][i]);
  }
  return split;
}

std::array<SetBounds, 2> divide_at_bin(std::span<const BuildReference> references, const BinnedSplit& split,
                                       BuildReference* left, BuildReference* right) {
  const std::array<Box4, 2> centers = references.size() < kParallelScan
                                          ? copy_parts(references, split, left, right)
                                          : copy_parts_in_parallel(references, split, left, right);
  return {SetBounds{split.boxes[0], centers[0]}, SetBounds{split.boxes[1], centers[1]}};
}

}  // namespace gridcast::blas
