// Boxes beside each other, compiled once per instruction set: included by what writes groups.

#if defined(GRIDCAST_TLAS_GROUP_WRITER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_TLAS_GROUP_WRITER_INL_H_
#undef GRIDCAST_TLAS_GROUP_WRITER_INL_H_
#else
#define GRIDCAST_TLAS_GROUP_WRITER_INL_H_
#endif

#include <cstddef>

#include <hwy/highway.h>

#include "core/tlas/cell_lists.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::tlas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

static_assert(sizeof(BoxRecord) == 40 && offsetof(BoxRecord, instance_id) == 24 &&
              offsetof(BoxRecord, range) == 28);

#if HWY_TARGET == HWY_SCALAR
/// What BoxRecord::seen_from tells.
class Sides {
 public:
  static constexpr std::size_t kBits[6] = {0, 1, 2, 3, 4, 5};  ///< where BoxGroup::seen[k] is in of()
  HWY_INLINE explicit Sides(const CellNumbers& cell) : cell_{cell.lanes[2], cell.lanes[3], cell.lanes[4]} {}
  [[nodiscard]] HWY_INLINE std::uint32_t of(const BoxRecord& record) const { return record.seen_from(cell_); }

 private:
  Cell cell_;
};
#else
/// What BoxRecord::seen_from tells, by one comparison of the last sixteen bytes of a record: half of the id,
/// the other half, lower x, y, z and upper x, y, z. All bits of upper numbers are changed into their
/// opposites, so that they compare the other way.
class Sides {
 public:
  static constexpr std::size_t kBits[6] = {2, 5, 3, 6, 4, 7};  ///< where BoxGroup::seen[k] is in of()
  HWY_INLINE explicit Sides(const CellNumbers& cell) {
    const D d;
    constexpr std::uint16_t kAll = 0xFFFF;
    alignas(16) static constexpr std::uint16_t kOpposite[8] = {0, 0, 0, 0, 0, kAll, kAll, kAll};
    opposite_ = hn::Load(d, kOpposite);
    cell_ = hn::Xor(hn::Load(d, cell.lanes), opposite_);
  }
  [[nodiscard]] HWY_INLINE std::uint32_t of(const BoxRecord& record) const {
    const D d;
    const void* const numbers = &record.instance_id;
    const auto lanes = hn::LoadU(d, static_cast<const std::uint16_t*>(numbers));
    std::uint8_t bits[8] = {0};
    hn::StoreMaskBits(d, hn::Lt(hn::Xor(lanes, opposite_), cell_), bits);
    return bits[0];
  }

 private:
  using D = hn::FixedTag<std::uint16_t, 8>;
  hn::Vec<D> opposite_, cell_;
};
#endif

/// Writes whole groups of one cell.
class GroupWriter {
 public:
  HWY_INLINE explicit GroupWriter(const CellNumbers& cell) : sides_(cell) {}

  /// record(slot) is what goes into a slot: kNoRecord where it is not used.
  template <std::size_t kSlots, class RecordOf>
  HWY_INLINE void write(const RecordOf& record, NextGroup next, BoxGroup<kSlots>& group) const {
    for (std::size_t slot = 0; slot < kSlots; slot += 4) write_four(record, slot, group);
    std::uint64_t rows = 0;
    for (std::size_t slot = 0; slot < kSlots; ++slot)
      rows |= std::uint64_t(sides_.of(record(slot))) << (8 * slot);
    const std::uint64_t seen = transpose_bits(rows);
    for (std::size_t side = 0; side < 6; ++side)
      group.seen[side] = std::uint8_t(seen >> (8 * Sides::kBits[side]));
    group.seen[6] = 0;
    group.next = next;
  }

 private:
  /// Planes and links of four slots.
  template <std::size_t kSlots, class RecordOf>
  HWY_INLINE void write_four(const RecordOf& record, std::size_t slot, BoxGroup<kSlots>& group) const {
#if HWY_TARGET == HWY_SCALAR
    for (std::size_t k = 0; k < 4; ++k) {
      group.set_box(slot + k, record(slot + k).box);
      group.links[slot + k] = record(slot + k).instance_id;
    }
#else
    const hn::FixedTag<std::uint32_t, 4> d;
    alignas(16) std::uint32_t rows[8][4];
    for (std::size_t half = 0; half < 8; half += 4) {
      const auto load = [&](std::size_t k)
                            HWY_ATTR { return hn::LoadU(d, words_of(record(slot + k)) + half); };
      const auto a = load(0), b = load(1), c = load(2), e = load(3);
      const auto ab = hn::InterleaveLower(d, a, b), ce = hn::InterleaveLower(d, c, e);
      const auto upper_ab = hn::InterleaveUpper(d, a, b), upper_ce = hn::InterleaveUpper(d, c, e);
      hn::Store(hn::ConcatLowerLower(d, ce, ab), d, rows[half]);
      hn::Store(hn::ConcatUpperUpper(d, ce, ab), d, rows[half + 1]);
      hn::Store(hn::ConcatLowerLower(d, upper_ce, upper_ab), d, rows[half + 2]);
      hn::Store(hn::ConcatUpperUpper(d, upper_ce, upper_ab), d, rows[half + 3]);
    }
    for (std::size_t plane = 0; plane < 6; ++plane)
      __builtin_memcpy(&group.planes[plane / 3][plane % 3][slot], rows[plane], sizeof rows[plane]);
    __builtin_memcpy(&group.links[slot], rows[6], sizeof rows[6]);
#endif
  }

  /// A record as it lies in memory: six planes, the id, and the first two numbers of its cells.
  static HWY_INLINE const std::uint32_t* words_of(const BoxRecord& record) {
    const void* words = &record;
    return static_cast<const std::uint32_t*>(words);
  }

  Sides sides_;
};

}  // namespace gridcast::tlas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // GRIDCAST_TLAS_GROUP_WRITER_INL_H_
