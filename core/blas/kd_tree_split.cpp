#include "core/blas/kd_tree_split.h"

#include <algorithm>
#include <array>

#include "core/blas/cost_model.h"
#include "core/blas/kd_tree_node.h"

namespace gridcast::blas {
namespace {

/// What a split that cuts off empty space costs, relative to its surface-area cost: rays that only graze
/// the mesh leave early, which the heuristic does not see. Value of I. Wald, 2006.
constexpr double kEmptySideFactor = 0.8;

/// How many references a plane leaves on each side, those in the plane apart.
struct Counts {
  std::size_t below, planar, above;
};

/// Evaluates planes across one axis of a cell and keeps the cheapest. In double: squares of small floats
/// underflow. A cell without area is a line, where lengths take the place of areas.
class PlaneSearch {
 public:
  PlaneSearch(const Bounds3f& cell, std::optional<KdSplit>& best) : cell_(cell), best_(best) {}

  void start(int axis) {
    const Vec3d extent = to_double(cell_).extent();
    const double a = extent[(axis + 1) % 3];
    const double b = extent[(axis + 2) % 3];
    axis_ = axis;
    cap_ = a * b;
    girth_ = a + b;
    if (!(girth_ > 0.0)) girth_ = 1.0;
    whole_ = cap_ + girth_ * extent[axis];
  }

  void consider(float plane, const Counts& counts) {
    if (!(plane > cell_.lower[axis_] && plane < cell_.upper[axis_])) return;
    const double below = (cap_ + girth_ * (double(plane) - double(cell_.lower[axis_]))) / whole_;
    const double above = (cap_ + girth_ * (double(cell_.upper[axis_]) - double(plane))) / whole_;
    offer(plane, PlanarSide::kBelow, below, counts.below + counts.planar, above, counts.above);
    if (counts.planar != 0)
      offer(plane, PlanarSide::kAbove, below, counts.below, above, counts.above + counts.planar);
  }

 private:
  void offer(float plane, PlanarSide planar, double below, std::size_t below_count, double above,
             std::size_t above_count) {
    double cost = kKdNodeCost + kTriangleCost * (below * double(below_count) + above * double(above_count));
    if (below_count == 0 || above_count == 0) cost *= kEmptySideFactor;
    if (!best_ || cost < best_->cost) best_ = KdSplit{axis_, plane, planar, cost, below_count + above_count};
  }

  const Bounds3f& cell_;
  std::optional<KdSplit>& best_;
  int axis_ = 0;
  double cap_ = 0.0, girth_ = 0.0, whole_ = 1.0;
};

/// Every side of every box, from the lower to the upper end: the sorted sides tell at each of them how many
/// boxes begin below it and how many end above it.
void sweep(std::span<const KdReference> references, int axis, SweepMemory& memory, PlaneSearch& search) {
  auto& [lows, highs, planars] = memory;
  lows.clear();
  highs.clear();
  planars.clear();
  for (const KdReference& r : references) {
    lows.push_back(r.lower[axis]);
    highs.push_back(r.upper[axis]);
    if (r.lower[axis] == r.upper[axis]) planars.push_back(r.lower[axis]);
  }
  for (std::vector<float>* sides : {&lows, &highs, &planars}) std::sort(sides->begin(), sides->end());

  const std::size_t n = references.size();
  std::size_t begun = 0, ended = 0, flat = 0;
  while (ended < n) {
    const float plane = begun < n ? std::min(lows[begun], highs[ended]) : highs[ended];
    const std::size_t first_flat = flat;
    while (ended < n && highs[ended] == plane) ++ended;
    while (flat < planars.size() && planars[flat] == plane) ++flat;
    search.consider(plane, {begun, flat - first_flat, n - ended});
    while (begun < n && lows[begun] == plane) ++begun;
  }
}

constexpr std::size_t kBinCount = 32;

/// Planes at equal distances over the references' common box, both ends included. Triangles that lie in
/// an inner plane are counted on one side of it, which changes the estimate alone.
void try_bins(std::span<const KdReference> references, int axis, PlaneSearch& search) {
  float lower = references[0].lower[axis];
  float upper = references[0].upper[axis];
  for (const KdReference& r : references) {
    lower = std::min(lower, r.lower[axis]);
    upper = std::max(upper, r.upper[axis]);
  }
  const double width = (double(upper) - double(lower)) / double(kBinCount);
  const double scale = width > 0.0 ? 1.0 / width : 0.0;
  auto bin = [&](float x) {
    return std::min(std::size_t((double(x) - double(lower)) * scale), kBinCount - 1);
  };
  std::array<std::size_t, kBinCount> begins{}, ends{};
  std::size_t at_lower = 0, at_upper = 0;
  for (const KdReference& r : references) {
    ++begins[bin(r.lower[axis])];
    ++ends[bin(r.upper[axis])];
    at_lower += std::size_t(r.upper[axis] == lower);
    at_upper += std::size_t(r.lower[axis] == upper);
  }

  const std::size_t n = references.size();
  search.consider(lower, {0, at_lower, n - at_lower});
  if (lower == upper) return;
  std::size_t begun = 0, ended = 0;
  for (std::size_t i = 1; i < kBinCount; ++i) {
    begun += begins[i - 1];
    ended += ends[i - 1];
    search.consider(float(double(lower) + double(i) * width), {begun, 0, n - ended});
  }
  search.consider(upper, {n - at_upper, at_upper, 0});
}

}  // namespace

std::optional<KdSplit> find_split(std::span<const KdReference> references, const Bounds3f& cell,
                                  SweepMemory& memory) {
  std::optional<KdSplit> best;
  if (references.empty()) return best;
  PlaneSearch search(cell, best);
  for (int axis = 0; axis < 3; ++axis) {
    search.start(axis);
    if (references.size() <= kExactSplits)
      sweep(references, axis, memory, search);
    else
      try_bins(references, axis, search);
  }
  return best;
}

}  // namespace gridcast::blas
