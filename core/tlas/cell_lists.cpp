// Compiled once per instruction set and chosen at run time by Highway. It only moves bits.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/tlas/cell_lists.cpp"  // NOLINT: Highway includes this file once per target

#include "core/tlas/cell_lists.h"

#include <algorithm>
#include <bit>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/tlas/group_writer-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::tlas::HWY_NAMESPACE {

constexpr std::size_t kWordBits = 64;

/// The cells of a block that list a record which reaches into it.
HWY_INLINE std::uint64_t cells_of(const BoxRecord& record, const BlockShape& shape, const Cell& first) {
  std::size_t from[3], up_to[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::uint32_t begin = first[axis], last = shape.last[axis];
    const std::uint32_t lower = record.range.lower[axis], upper = record.range.upper[axis];
    from[axis] = lower > begin ? lower - begin : 0;
    up_to[axis] = std::min(upper - begin, last);
  }
  return shape.from[0][from[0]] & shape.from[1][from[1]] & shape.from[2][from[2]] & shape.up_to[0][up_to[0]] &
         shape.up_to[1][up_to[1]] & shape.up_to[2][up_to[2]];
}

/// Swaps the squares of bits beside the diagonal, by rows that are `kDistance` apart.
template <std::size_t kDistance>
HWY_INLINE void swap_squares(std::uint64_t lower, std::uint64_t* rows) {
  for (std::size_t first = 0; first < kWordBits; first += 2 * kDistance)
    for (std::size_t k = first; k < first + kDistance; ++k) {
      const std::uint64_t differ = ((rows[k] >> kDistance) ^ rows[k + kDistance]) & lower;
      rows[k] ^= differ << kDistance;
      rows[k + kDistance] ^= differ;
    }
}

/// Bit j of row i becomes bit i of row j: "Hacker's Delight", H. Warren, 2003, section 7-3.
HWY_INLINE void transpose(std::uint64_t* rows) {
  swap_squares<32>(0x00000000FFFFFFFF, rows);
  swap_squares<16>(0x0000FFFF0000FFFF, rows);
  swap_squares<8>(0x00FF00FF00FF00FF, rows);
  swap_squares<4>(0x0F0F0F0F0F0F0F0F, rows);
  swap_squares<2>(0x3333333333333333, rows);
  swap_squares<1>(0x5555555555555555, rows);
}

void find_cells(const BlockShape& shape, const Cell& first, std::span<const BoxRecord> records,
                std::uint64_t wanted, std::uint64_t* words, std::uint32_t* sizes) {
  std::fill(sizes, sizes + BlockShape::kMostCells, 0U);
  for (std::size_t begin = 0; begin < records.size(); begin += kWordBits, words += kWordBits) {
    const std::size_t count = std::min(kWordBits, records.size() - begin);
    for (std::size_t k = 0; k < count; ++k) words[k] = cells_of(records[begin + k], shape, first) & wanted;
    std::fill(words + count, words + kWordBits, std::uint64_t(0));
    transpose(words);
    for (std::size_t local = 0; local < BlockShape::kMostCells; ++local)
      sizes[local] += std::uint32_t(std::popcount(words[local]));
  }
}

/// Appends the numbers of the bits. Four at a time, of which those beyond the last are written over later: a
/// loop over the right number ends in a wrong guess time and again.
HWY_INLINE std::uint32_t* append_numbers(std::uint64_t bits, std::size_t first, std::uint32_t* to) {
  const auto count = std::ptrdiff_t(std::popcount(bits));
  for (std::uint32_t* at = to; bits != 0; at += 4)
    for (std::size_t k = 0; k < 4; ++k) {
      at[k] = std::uint32_t(first) + std::uint32_t(std::countr_zero(bits));
      bits &= bits - 1;
    }
  return to + count;
}

/// `numbers` end in seven of kNoRecord.
HWY_INLINE void write_groups(const FlatCell& flat, const BoxRecord* records, const std::uint32_t* numbers,
                             std::size_t count) {
  const GroupWriter writer(flat.cell);
  const auto record = [&](std::size_t slot) HWY_ATTR -> const BoxRecord& { return records[numbers[slot]]; };
  std::byte* at = flat.at;
  while (count > 4) {
    const std::size_t left = count - std::min<std::size_t>(count, 8);
    auto* group = new (at) BoxGroup<8>;
    writer.write(record, left == 0 ? NextGroup::kNone : (left > 4 ? NextGroup::kEight : NextGroup::kFour),
                 *group);
    at += sizeof *group;
    numbers += 8;
    count = left;
  }
  if (count > 0) writer.write(record, NextGroup::kNone, *new (at) BoxGroup<4>);
}

void write_cells(std::span<const FlatCell> cells, std::span<const BoxRecord> records,
                 const std::uint64_t* words) {
  std::uint32_t numbers[kMaxFlat + 8];
  const std::size_t listed = records.size() - 1;
  for (const FlatCell& flat : cells) {
    std::uint32_t* end = numbers;
    for (std::size_t begin = 0; begin < listed; begin += kWordBits)
      end = append_numbers(words[begin + flat.local], begin, end);
    std::fill(end, end + 7, std::uint32_t(listed));
    write_groups(flat, records.data(), numbers, std::size_t(end - numbers));
  }
}

void write_one_group(const BoxRecord* const* records, const CellNumbers& cell, BoxGroup<8>& group) {
  const auto record = [&](std::size_t slot) HWY_ATTR -> const BoxRecord& { return *records[slot]; };
  GroupWriter(cell).write(record, NextGroup::kNone, group);
}

}  // namespace gridcast::tlas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::tlas {

HWY_EXPORT(find_cells);
HWY_EXPORT(write_cells);
HWY_EXPORT(write_one_group);

BlockShape::BlockShape(const GridLayout& layout) {
  for (std::size_t axis = 0; axis < 3; ++axis) last[axis] = std::uint16_t((1U << layout.shift[axis]) - 1U);
  CellRange{{0, 0, 0}, last}.for_each([&](const Cell& cell) {
    const std::uint64_t bit = std::uint64_t(1) << layout.local_of(cell);
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::size_t k = 0; k <= last[axis]; ++k) {
        if (cell[axis] >= k) from[axis][k] |= bit;
        if (cell[axis] <= k) up_to[axis][k] |= bit;
      }
  });
}

void write_group(const BoxRecord* const* records, const CellNumbers& cell, BoxGroup<8>& group) {
  HWY_DYNAMIC_DISPATCH(write_one_group)(records, cell, group);
}

void CellLists::find(const BlockShape& shape, const Cell& first, std::span<const BoxRecord> records,
                     std::uint64_t wanted) {
  records_ = records;
  const std::size_t listed = records.size() - 1;
  words_.resize((listed + 63) / 64 * 64);
  HWY_DYNAMIC_DISPATCH(find_cells)
  (shape, first, records.first(listed), wanted, words_.data(), sizes_.data());
}

void CellLists::append(std::uint32_t local, std::vector<const BoxRecord*>& to) const {
  for (std::size_t begin = 0; begin + 1 < records_.size(); begin += 64)
    for (std::uint64_t bits = words_[begin + local]; bits != 0; bits &= bits - 1)
      to.push_back(&records_[begin + std::size_t(std::countr_zero(bits))]);
}

void CellLists::write(std::span<const FlatCell> cells) const {
  HWY_DYNAMIC_DISPATCH(write_cells)(cells, records_, words_.data());
}

}  // namespace gridcast::tlas
#endif
