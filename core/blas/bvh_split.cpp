#include "core/blas/bvh_split.h"

#include <algorithm>
#include <array>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

#include "core/blas/cost_model.h"

namespace gridcast::blas {
namespace {

/// Sets above this are scanned in parallel; below, starting tasks costs more than it saves.
constexpr std::size_t kParallelScan = 1 << 15;
constexpr std::size_t kScanGrain = 1 << 13;

constexpr std::uint32_t kMaxBins = 16;
constexpr std::uint32_t kMinBins = 4;
/// Axes on which all centers lie closer are not binned: bins per length would overflow a float.
constexpr float kMinExtent = 0x1p-120F;

int longest_axis(const Bounds3f& box) {
  const Vec3f extent = box.extent();
  if (extent.x >= extent.y) return extent.x >= extent.z ? 0 : 2;
  return extent.y >= extent.z ? 1 : 2;
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

/// Center to bin. The same code counts and divides, so a part is never emptier than its count.
class BinMap {
 public:
  BinMap(const Bounds3f& centers, std::uint32_t bin_count) : origin_(centers.lower), last_(bin_count - 1) {
    const Vec3f extent = centers.extent();
    for (int axis = 0; axis < 3; ++axis)
      scale_[axis] = extent[axis] > kMinExtent ? float(bin_count) / extent[axis] : 0.F;
  }
  [[nodiscard]] bool usable(int axis) const { return scale_[axis] > 0.F; }
  [[nodiscard]] std::uint32_t bin(const BuildReference& reference, int axis) const {
    const float center = reference.lower[axis] + reference.upper[axis];
    return std::min(std::uint32_t((center - origin_[axis]) * scale_[axis]), last_);
  }

 private:
  Vec3f origin_;
  Vec3f scale_;
  std::uint32_t last_;
};

struct Bin {
  Bounds3f box;
  std::uint32_t count = 0;
};

struct BinSet {
  std::array<std::array<Bin, kMaxBins>, 3> axes;

  void add(std::span<const BuildReference> references, const BinMap& map) {
    for (const BuildReference& reference : references) {
      for (int axis = 0; axis < 3; ++axis) {
        Bin& bin = axes[std::size_t(axis)][map.bin(reference, axis)];
        bin.box.lower = glm::min(bin.box.lower, reference.lower);
        bin.box.upper = glm::max(bin.box.upper, reference.upper);
        ++bin.count;
      }
    }
  }
  void merge(const BinSet& other) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < kMaxBins; ++i) {
        axes[axis][i].box.extend(other.axes[axis][i].box);
        axes[axis][i].count += other.axes[axis][i].count;
      }
    }
  }
};

BinSet fill_bins(std::span<const BuildReference> references, const BinMap& map) {
  BinSet all;
  if (references.size() < kParallelScan) {
    all.add(references, map);
    return all;
  }
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, references.size(), kScanGrain), BinSet{},
      [&](const tbb::blocked_range<std::size_t>& range, BinSet bins) {
        bins.add(references.subspan(range.begin(), range.size()), map);
        return bins;
      },
      [](BinSet a, const BinSet& b) {
        a.merge(b);
        return a;
      });
}

/// The bins of one axis swept from the right, then from the left: area times count on both sides of each
/// plane. Keeps `best` unless a plane is strictly cheaper.
void sweep_axis(const std::array<Bin, kMaxBins>& bins, int axis, std::uint32_t bin_count,
                std::optional<BinnedSplit>& best) {
  std::array<double, kMaxBins> right_cost{};
  Bounds3f box;
  std::size_t count = 0;
  for (std::uint32_t i = bin_count - 1; i > 0; --i) {
    box.extend(bins[i].box);
    count += bins[i].count;
    right_cost[i] = count == 0 ? -1.0 : to_double(box).half_area() * double(count);
  }
  box = {};
  count = 0;
  for (std::uint32_t i = 1; i < bin_count; ++i) {
    box.extend(bins[i - 1].box);
    count += bins[i - 1].count;
    if (count == 0 || right_cost[i] < 0.0) continue;
    const double cost = to_double(box).half_area() * double(count) + right_cost[i];
    if (!best || cost < best->cost) best = BinnedSplit{axis, i, bin_count, cost};
  }
}

std::uint32_t bins_for(std::size_t size) {
  return std::uint32_t(std::clamp<std::size_t>(size, kMinBins, kMaxBins));
}

}  // namespace

SetBounds bounds_of(std::span<const BuildReference> references) {
  auto scan = [&](std::size_t begin, std::size_t end, SetBounds bounds) {
    for (std::size_t i = begin; i < end; ++i) bounds.extend(references[i]);
    return bounds;
  };
  if (references.size() < kParallelScan) return scan(0, references.size(), {});
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, references.size(), kScanGrain), SetBounds{},
      [&](const tbb::blocked_range<std::size_t>& range, const SetBounds& bounds) {
        return scan(range.begin(), range.end(), bounds);
      },
      [](SetBounds a, const SetBounds& b) {
        a.extend(b);
        return a;
      });
}

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
  const float middle = bounds.centers.center()[axis];
  // Every center is at or above the lower end; one lies on it, one on the upper end.
  if (!(middle > bounds.centers.lower[axis])) return std::nullopt;
  return partition(references, [axis, middle](const BuildReference& reference) {
    return reference.lower[axis] + reference.upper[axis] < middle;
  });
}

std::optional<BinnedSplit> find_binned_split(std::span<const BuildReference> references,
                                             const SetBounds& bounds) {
  const std::uint32_t bin_count = bins_for(references.size());
  const BinMap map(bounds.centers, bin_count);
  const BinSet bins = fill_bins(references, map);
  std::optional<BinnedSplit> best;
  for (int axis = 0; axis < 3; ++axis)
    if (map.usable(axis)) sweep_axis(bins.axes[std::size_t(axis)], axis, bin_count, best);
  if (!best) return best;
  const double area = to_double(bounds.boxes).half_area();
  best->cost = kNodeCost + (area > 0.0 ? kTriangleCost * best->cost / area : 0.0);
  return best;
}

Division divide_at_bin(std::span<BuildReference> references, const SetBounds& bounds,
                       const BinnedSplit& split) {
  const BinMap map(bounds.centers, split.bin_count);
  return partition(references, [&](const BuildReference& reference) {
    return map.bin(reference, split.axis) < split.bin;
  });
}

}  // namespace gridcast::blas
