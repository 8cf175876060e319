// Compiled once per instruction set and chosen at run time by Highway. The same operations in the same order
// as in GridLayout, none of them fused.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/tlas/block_filing.cpp"  // NOLINT: Highway includes this file once per target

#include "core/tlas/block_filing.h"

#include <algorithm>
#include <array>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/math/lane_rows-inl.h"
#include "core/tlas/box_rows.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::tlas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using gridcast::HWY_NAMESPACE::Four;
using gridcast::HWY_NAMESPACE::load_rows;
using D = hn::CappedTag<double, 8>;
using V = hn::Vec<D>;
using I = hn::Rebind<std::int32_t, D>;
constexpr std::size_t kLanes = hn::MaxLanes(D());
static_assert(BlockFiling::kChunk % kLanes == 0);

/// Boxes, one in each lane.
struct BoxLanes {
  V lower[3], upper[3], drift;

  HWY_INLINE explicit BoxLanes(const InstanceBox* boxes) {
    std::array<const double*, kLanes> rows;
    for (std::size_t k = 0; k < kLanes; ++k) rows[k] = BoxRows::of(boxes[k]);
    const D d;
    const Four<D> first = load_rows(d, rows);
    for (const double*& row : rows) row += BoxRows::kUpper;
    const Four<D> second = load_rows(d, rows);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower[axis] = first.v[axis];
      upper[axis] = second.v[axis];
    }
    const hn::Rebind<float, D> f;
    const hn::Rebind<std::uint32_t, D> u32;
    const hn::Rebind<std::uint64_t, D> u64;
    drift = hn::PromoteTo(d, hn::BitCast(f, hn::TruncateTo(u32, hn::BitCast(u64, second.v[3]))));
  }

  /// Lanes of the boxes that are not empty.
  [[nodiscard]] HWY_INLINE hn::Mask<D> reachable() const {
    return hn::And(hn::And(hn::Le(lower[0], upper[0]), hn::Le(lower[1], upper[1])),
                   hn::Le(lower[2], upper[2]));
  }
};

/// What is added up lane by lane.
class Sums {
 public:
  HWY_INLINE Sums() {
    const D d;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least_[axis] = hn::Set(d, hwy::HighestValue<double>());
      most_[axis] = hn::Neg(least_[axis]);
    }
    references_ = max_drift_ = hn::Zero(d);
  }
  HWY_INLINE void add(const BoxLanes& boxes, hn::Mask<D> reachable, hn::Mask<D> filed, V references) {
    const D d;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least_[axis] = hn::Min(least_[axis], hn::IfThenElse(reachable, boxes.lower[axis], least_[axis]));
      most_[axis] = hn::Max(most_[axis], hn::IfThenElse(reachable, boxes.upper[axis], most_[axis]));
    }
    references_ = references_ + hn::IfThenElseZero(filed, references);
    max_drift_ = hn::Max(max_drift_, hn::IfThenElseZero(filed, boxes.drift));
    reachable_ += hn::CountTrue(d, reachable);
    filed_ += hn::CountTrue(d, filed);
  }
  HWY_INLINE void add_to(FilingSummary& summary) const {
    const D d;
    if (reachable_ == 0) return;
    Bounds3d bounds;
    for (int axis = 0; axis < 3; ++axis) {
      bounds.lower[axis] = hn::GetLane(hn::MinOfLanes(d, least_[axis]));
      bounds.upper[axis] = hn::GetLane(hn::MaxOfLanes(d, most_[axis]));
    }
    summary.bounds.extend(bounds);
    summary.reachable += reachable_;
    summary.filed += filed_;
    summary.references += std::uint64_t(hn::GetLane(hn::SumOfLanes(d, references_)));
    summary.max_drift = std::max(summary.max_drift, float(hn::GetLane(hn::MaxOfLanes(d, max_drift_))));
  }

 private:
  V least_[3], most_[3];
  V references_;  ///< whole numbers: a chunk's boxes are in fewer than 2^53 cells
  V max_drift_;
  std::size_t reachable_ = 0, filed_ = 0;
};

std::uint64_t file(const BlockFiling::Grid& grid, const InstanceBox* chunk, std::size_t count,
                   std::uint32_t* first_block, BlockFiling::Corners& corners, FilingSummary& summary) {
  const D d;
  const I i;
  const hn::Rebind<std::uint64_t, D> u64;
  const hn::Rebind<std::uint32_t, D> u32;
  Sums sums;
  std::uint64_t in_several = 0;
  for (std::size_t first = 0; first < count; first += kLanes) {
    const BoxLanes boxes(chunk + first);
    const auto reachable = hn::And(boxes.reachable(), hn::FirstN(d, std::min(kLanes, count - first)));
    const V pad = boxes.drift * hn::Set(d, grid.reach) + hn::Set(d, grid.slack);
    auto filed = reachable;
    V references = hn::Set(d, 1.0);
    hn::Vec<I> numbers, differ = hn::Zero(i);
    for (int axis = 2; axis >= 0; --axis) {
      const V lower = hn::Set(d, grid.lower[axis]), inverse_cell = hn::Set(d, grid.inverse_cell[axis]);
      const V from = boxes.lower[axis] - pad, to = boxes.upper[axis] + pad;
      filed = hn::And(filed, hn::And(hn::Ge(from, lower), hn::Le(to, hn::Set(d, grid.upper[axis]))));
      const auto cell_of = [&](V x) HWY_ATTR {
        const V index = (x - lower) * inverse_cell;
        return hn::DemoteTo(i, hn::Min(hn::Max(index, hn::Zero(d)), hn::Set(d, grid.last_cell[axis])));
      };
      const auto first_cell = cell_of(from), last_cell = cell_of(to);
      references = references * hn::PromoteTo(d, last_cell - first_cell + hn::Set(i, 1));
      const auto first_of_axis = hn::ShiftRightSame(first_cell, grid.shift[axis]),
                 last_of_axis = hn::ShiftRightSame(last_cell, grid.shift[axis]);
      hn::StoreU(hn::BitCast(u32, first_of_axis), u32, corners.at[axis] + first);
      hn::StoreU(hn::BitCast(u32, last_of_axis), u32, corners.at[axis + 3] + first);
      differ = hn::Or(differ, hn::Xor(first_of_axis, last_of_axis));
      numbers =
          axis == 2 ? first_of_axis : numbers * hn::Set(i, axis == 1 ? grid.rows : grid.row) + first_of_axis;
    }
    sums.add(boxes, reachable, filed, references);
    const auto is_filed = hn::BitCast(i, hn::TruncateTo(u32, hn::BitCast(u64, hn::VecFromMask(d, filed))));
    hn::StoreU(hn::BitCast(u32, hn::Or(numbers, hn::Not(is_filed))), u32, first_block + first);
    std::uint8_t bits[8] = {0};
    hn::StoreMaskBits(i, hn::Ne(hn::And(differ, is_filed), hn::Zero(i)), bits);
    in_several |= std::uint64_t(bits[0]) << first;
  }
  sums.add_to(summary);
  return in_several;
}

}  // namespace gridcast::tlas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::tlas {

HWY_EXPORT(file);

BlockFiling::BlockFiling(const GridLayout& layout) {
  for (int axis = 0; axis < 3; ++axis) {
    grid_.lower[axis] = layout.bounds.lower[axis];
    grid_.upper[axis] = layout.bounds.upper[axis];
    grid_.inverse_cell[axis] = layout.inverse_cell[axis];
    grid_.last_cell[axis] = double(layout.cells[axis] - 1);
    grid_.shift[axis] = int(layout.shift[axis]);
  }
  grid_.reach = layout.reach;
  grid_.slack = layout.slack;
  grid_.row = std::int32_t(layout.blocks[0]);
  grid_.rows = std::int32_t(layout.blocks[1]);
}

std::uint64_t BlockFiling::file(const InstanceBox* chunk, std::size_t count, std::uint32_t* first_block,
                                Corners& corners, FilingSummary& summary) const {
  return HWY_DYNAMIC_DISPATCH(file)(grid_, chunk, count, first_block, corners, summary);
}

}  // namespace gridcast::tlas
#endif
