// Every side of every box of a small cell as a plane, compiled once per instruction set and chosen at run
// time by Highway. Counts are whole numbers and costs use no fused operation: the tree is the same on each.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/blas/kd_tree_sweep.cpp"  // NOLINT: Highway includes this file once per target

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/blas/kd_tree_split.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using DU = hn::RebindToUnsigned<D>;

/// The boxes' sides as columns, with room for a whole vector at the end.
struct Columns {
  static constexpr std::size_t kSize = kExactSplits + 16;
  alignas(64) float sides[3][2][kSize];  ///< [axis][lower, upper]
  bool flat[3];                          ///< some box has no extent there
};

void fill(std::span<const KdReference> references, const Bounds3f& cell, Columns& columns) {
  const std::size_t n = references.size();
  for (int axis = 0; axis < 3; ++axis) {
    float* const lows = columns.sides[axis][0];
    float* const highs = columns.sides[axis][1];
    bool flat = false;
    for (std::size_t i = 0; i < n; ++i) {
      lows[i] = references[i].lower[axis];
      highs[i] = references[i].upper[axis];
      flat |= lows[i] == highs[i];
    }
    columns.flat[axis] = flat;
    // The cell's own side is no plane strictly inside.
    for (std::size_t i = n; i < n + 16; ++i) lows[i] = highs[i] = cell.lower[axis];
  }
}

/// A side as a number: by axis, then lower before upper, then the box, then the side where flat boxes go.
constexpr std::uint32_t code_of(std::uint32_t axis, std::uint32_t end, std::uint32_t box,
                                std::uint32_t planar) {
  return (((axis * 2 + end) * std::uint32_t(kExactSplits) + box) << 1) | planar;
}

/// The best of what each lane has seen, the first among equals.
struct BestLanes {
  alignas(64) float cost[16];
  alignas(64) std::uint32_t code[16];
};

HWY_INLINE void sweep_axis(const Columns& columns, std::size_t n, const Bounds3f& cell, std::uint32_t axis,
                           BestLanes& best) {
  const D d;
  const DU du;
  const CellShape shape(cell, int(axis));
  const auto lower = hn::Set(d, cell.lower[int(axis)]);
  const auto upper = hn::Set(d, cell.upper[int(axis)]);
  const auto inverse = hn::Set(d, 1.F / (cell.upper[int(axis)] - cell.lower[int(axis)]));
  const auto cap = hn::Set(d, shape.cap);
  const auto girth = hn::Set(d, shape.girth);
  const auto one = hn::Set(d, 1.F);
  const auto quarter = hn::Set(d, 0.25F);
  const auto infinity = hn::Set(d, std::numeric_limits<float>::infinity());
  const float* const lows = columns.sides[axis][0];
  const float* const highs = columns.sides[axis][1];
  auto best_cost = hn::Load(d, best.cost);
  auto best_code = hn::Load(du, best.code);

  for (std::uint32_t end = 0; end < 2; ++end) {
    for (std::size_t i = 0; i < n; i += hn::Lanes(d)) {
      const auto plane = hn::Load(d, columns.sides[axis][end] + i);
      auto begun = hn::Zero(d);    // boxes that begin below the plane
      auto unended = hn::Zero(d);  // boxes that end above it
      auto planar = hn::Zero(d);   // boxes in it
      for (std::size_t k = 0; k < n; ++k) {
        begun = hn::Add(begun, hn::IfThenElseZero(hn::Lt(hn::Set(d, lows[k]), plane), one));
        unended = hn::Add(unended, hn::IfThenElseZero(hn::Gt(hn::Set(d, highs[k]), plane), one));
      }
      if (columns.flat[axis]) {
        for (std::size_t k = 0; k < n; ++k)
          if (lows[k] == highs[k])
            planar = hn::Add(planar, hn::IfThenElseZero(hn::Eq(hn::Set(d, lows[k]), plane), one));
      }
      const auto inside = hn::And(hn::Gt(plane, lower), hn::Lt(plane, upper));
      const auto below = hn::Add(cap, hn::Mul(girth, hn::Mul(hn::Sub(plane, lower), inverse)));
      const auto above = hn::Add(cap, hn::Mul(girth, hn::Mul(hn::Sub(upper, plane), inverse)));
      const auto offer = [&](auto below_count, auto above_count, std::uint32_t planar_side) {
        const auto blocks_below = hn::Ceil(hn::Mul(below_count, quarter));
        const auto blocks_above = hn::Ceil(hn::Mul(above_count, quarter));
        auto cost = hn::Add(hn::Set(d, kKdPlaneCost),
                            hn::Add(hn::Mul(below, blocks_below), hn::Mul(above, blocks_above)));
        const auto one_empty = hn::Lt(hn::Min(below_count, above_count), one);
        cost = hn::IfThenElse(one_empty, hn::Mul(cost, hn::Set(d, kEmptySideFactor)), cost);
        cost = hn::IfThenElse(inside, cost, infinity);
        const auto better = hn::Lt(cost, best_cost);
        const auto code = hn::Add(hn::Set(du, code_of(axis, end, std::uint32_t(i), planar_side)),
                                  hn::ShiftLeft<1>(hn::Iota(du, 0)));
        best_cost = hn::IfThenElse(better, cost, best_cost);
        best_code = hn::IfThenElse(hn::RebindMask(du, better), code, best_code);
      };
      offer(hn::Add(begun, planar), unended, 0);
      if (columns.flat[axis]) offer(begun, hn::Add(unended, planar), 1);
    }
  }
  hn::Store(best_cost, d, best.cost);
  hn::Store(best_code, du, best.code);
}

/// The cost and code of the best side; infinity when there is none.
float sweep(std::span<const KdReference> references, const Bounds3f& cell, KdSplit& best) {
  Columns columns;
  fill(references, cell, columns);
  BestLanes lanes;
  for (std::size_t i = 0; i < 16; ++i) {
    lanes.cost[i] = std::numeric_limits<float>::infinity();
    lanes.code[i] = ~0U;
  }
  for (std::uint32_t axis = 0; axis < 3; ++axis) sweep_axis(columns, references.size(), cell, axis, lanes);
  std::size_t chosen = 0;
  for (std::size_t i = 1; i < hn::Lanes(D()); ++i)
    if (lanes.cost[i] < lanes.cost[chosen] ||
        (lanes.cost[i] == lanes.cost[chosen] && lanes.code[i] < lanes.code[chosen]))
      chosen = i;
  best.cost = lanes.cost[chosen];
  if (best.cost == std::numeric_limits<float>::infinity()) return best.cost;
  const std::uint32_t code = lanes.code[chosen];
  const std::uint32_t side = (code >> 1) / kExactSplits;
  best.axis = int(side / 2);
  best.plane = columns.sides[side / 2][side % 2][(code >> 1) % kExactSplits];
  best.planar = (code & 1) != 0 ? PlanarSide::kAbove : PlanarSide::kBelow;
  return best.cost;
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::blas {

HWY_EXPORT(sweep);

std::optional<KdSplit> find_exact_split(std::span<const KdReference> references, const Bounds3f& cell) {
  KdSplit best;
  const float cost = HWY_DYNAMIC_DISPATCH(sweep)(references, cell, best);
  if (cost == std::numeric_limits<float>::infinity()) return std::nullopt;
  return best;
}

}  // namespace gridcast::blas
#endif
