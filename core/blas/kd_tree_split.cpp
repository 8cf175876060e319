#include "core/blas/kd_tree_split.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace gridcast::blas {
namespace {

constexpr int kBinCount = 32;

/// How many references a plane leaves on each side, those in the plane apart.
struct Counts {
  std::uint32_t below, planar, above;
};

/// Evaluates planes across one axis of a cell and keeps the cheapest.
class PlaneSearch {
 public:
  PlaneSearch(const Bounds3f& cell, int axis, std::optional<KdSplit>& best)
      : lower_(cell.lower[axis]),
        upper_(cell.upper[axis]),
        axis_(axis),
        shape_(cell, axis),
        inverse_(1.F / (upper_ - lower_)),
        best_(best) {}

  void consider(float plane, const Counts& counts) {
    if (!(plane > lower_ && plane < upper_)) return;
    const float below = shape_.cap + shape_.girth * ((plane - lower_) * inverse_);
    const float above = shape_.cap + shape_.girth * ((upper_ - plane) * inverse_);
    offer(plane, PlanarSide::kBelow, below, counts.below + counts.planar, above, counts.above);
    if (counts.planar != 0)
      offer(plane, PlanarSide::kAbove, below, counts.below, above, counts.above + counts.planar);
  }

 private:
  void offer(float plane, PlanarSide planar, float below, std::uint32_t below_count, float above,
             std::uint32_t above_count) {
    float cost = kKdPlaneCost + below * leaf_cost(below_count) + above * leaf_cost(above_count);
    if (below_count == 0 || above_count == 0) cost *= kEmptySideFactor;
    if (cost < (best_ ? best_->cost : std::numeric_limits<float>::infinity()))
      best_ = KdSplit{axis_, plane, planar, cost};
  }

  float lower_, upper_;
  int axis_;
  CellShape shape_;
  float inverse_;
  std::optional<KdSplit>& best_;
};

/// Counts of one axis: how many boxes begin and end in each bin.
struct Bins {
  std::array<std::uint32_t, kBinCount> begins{}, ends{};
  std::uint32_t at_lower = 0, at_upper = 0;  ///< flat boxes at the ends of the common box
};

/// Planes at equal distances over the references' common box, both ends included. Triangles that lie in
/// an inner plane are counted on one side of it, which changes the estimate alone.
void try_bins(const Bins& bins, float lower, float upper, std::uint32_t n, PlaneSearch search) {
  search.consider(lower, {0, bins.at_lower, n - bins.at_lower});
  if (lower == upper) return;
  const double width = (double(upper) - double(lower)) / double(kBinCount);
  std::uint32_t begun = 0, ended = 0;
  for (std::size_t i = 1; i < kBinCount; ++i) {
    begun += bins.begins[i - 1];
    ended += bins.ends[i - 1];
    search.consider(float(double(lower) + double(i) * width), {begun, 0, n - ended});
  }
  search.consider(upper, {n - bins.at_upper, bins.at_upper, 0});
}

std::optional<KdSplit> find_binned_split(std::span<const KdReference> references, const Bounds3f& cell) {
  Bounds3f common;
  for (const KdReference& r : references) common.extend(Bounds3f{r.lower, r.upper});
  Vec3f scale(0.F);
  for (int axis = 0; axis < 3; ++axis) {
    const float whole = float(kBinCount) / (common.upper[axis] - common.lower[axis]);
    if (std::isfinite(whole)) scale[axis] = whole;
  }
  Bins bins[3];
  for (const KdReference& r : references) {
    for (int axis = 0; axis < 3; ++axis) {
      Bins& b = bins[axis];
      const auto bin = [&](float x) {
        return std::size_t(std::min(int((x - common.lower[axis]) * scale[axis]), kBinCount - 1));
      };
      ++b.begins[bin(r.lower[axis])];
      ++b.ends[bin(r.upper[axis])];
      b.at_lower += std::uint32_t(r.upper[axis] == common.lower[axis]);
      b.at_upper += std::uint32_t(r.lower[axis] == common.upper[axis]);
    }
  }
  std::optional<KdSplit> best;
  for (int axis = 0; axis < 3; ++axis)
    try_bins(bins[axis], common.lower[axis], common.upper[axis], std::uint32_t(references.size()),
             PlaneSearch(cell, axis, best));
  return best;
}

}  // namespace

// In double: squares of small floats underflow.
CellShape::CellShape(const Bounds3f& cell, int axis) {
  const Vec3d extent = to_double(cell).extent();
  const double a = extent[(axis + 1) % 3];
  const double b = extent[(axis + 2) % 3];
  const double around = a + b > 0.0 ? (a + b) * extent[axis] : extent[axis];
  const double whole = a * b + around;
  cap = float(a * b / whole);
  girth = float(around / whole);
}

std::optional<KdSplit> find_split(std::span<const KdReference> references, const Bounds3f& cell) {
  if (references.empty()) return std::nullopt;
  if (references.size() <= kExactSplits) return find_exact_split(references, cell);
  return find_binned_split(references, cell);
}

}  // namespace gridcast::blas
