// The blocks of boxes, found many at once.

#include "core/tlas/block_filing.h"

#include <array>
#include <set>

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"
#include "tests/unit/tlas/filing_fixture.h"

namespace gridcast::tlas {
namespace {

constexpr std::size_t kChunk = BlockFiling::kChunk;

std::set<std::uint32_t> blocks_of(const GridLayout& layout, const CellRange& range) {
  std::set<std::uint32_t> blocks;
  range.for_each([&](const Cell& cell) { blocks.insert(layout.block_of(cell[0], cell[1], cell[2])); });
  return blocks;
}

void add(FilingSummary& sum, const GridLayout& layout, const InstanceBox& box) {
  const CellRange range = layout.range_of(box);
  if (box.bounds.empty()) return;
  sum.bounds.extend(box.bounds);
  ++sum.reachable;
  if (range.empty()) return;
  ++sum.filed;
  sum.references += range.cell_count();
  sum.max_drift = std::max(sum.max_drift, box.drift);
}

/// The first `count` boxes of a chunk, each filed as GridLayout::range_of says.
void expect_filed(const GridLayout& layout, const std::array<InstanceBox, kChunk>& boxes, std::size_t count,
                  FilingSummary& sum, FilingSummary& expected) {
  const BlockFiling filing(layout);
  std::uint32_t first_block[kChunk];
  BlockFiling::Corners corners;
  const std::uint64_t in_several = filing.file(boxes.data(), count, first_block, corners, sum);
  EXPECT_EQ(count < 64 ? in_several >> count : 0, 0U);
  for (std::size_t k = 0; k < count; ++k) {
    SCOPED_TRACE(k);
    const CellRange range = layout.range_of(boxes[k]);
    add(expected, layout, boxes[k]);
    std::set<std::uint32_t> others =
        range.cell_count() < 100000 ? blocks_of(layout, range) : std::set<std::uint32_t>();
    ASSERT_EQ(first_block[k] == kNoBlock, range.empty());
    if (range.empty()) {
      ASSERT_EQ((in_several >> k) & 1U, 0U);
    }
    if (others.empty()) continue;
    ASSERT_EQ(first_block[k], layout.block_of(range.lower[0], range.lower[1], range.lower[2]));
    ASSERT_EQ((in_several >> k) & 1U, std::uint64_t(others.size() > 1));
    others.erase(first_block[k]);
    std::set<std::uint32_t> found;
    filing.for_each_other(corners, k, [&](std::uint32_t block) { EXPECT_TRUE(found.insert(block).second); });
    ASSERT_EQ(found, others);
  }
}

TEST(BlockFiling, blocks_and_sums_are_those_of_the_layout_with_every_instruction_set) {
  test::Random random(test::seed_or(142));
  for (const std::string_view isa : instruction_sets()) {
    SCOPED_TRACE(isa);
    ASSERT_TRUE(limit_instruction_set(isa).ok());
    for (const GridLayout& layout : {layout_of_a_grid(16, 16, 16), layout_of_a_grid(1, 1, 1),
                                     layout_of_a_grid(65535, 1, 3), layout_of_a_grid(7, 500, 2)}) {
      FilingSummary sum, expected;
      for (std::size_t chunk = 0; chunk < 40; ++chunk) {
        const std::vector<InstanceBox> some = awkward_boxes(kChunk, random);
        std::array<InstanceBox, kChunk> boxes;
        std::copy(some.begin(), some.end(), boxes.begin());
        const std::size_t count = chunk < 30 ? kChunk : 1 + random.below(kChunk);
        ASSERT_NO_FATAL_FAILURE(expect_filed(layout, boxes, count, sum, expected));
      }
      EXPECT_EQ(sum.bounds, expected.bounds);
      EXPECT_EQ(sum.reachable, expected.reachable);
      EXPECT_EQ(sum.filed, expected.filed);
      EXPECT_EQ(sum.references, expected.references);
      EXPECT_EQ(sum.max_drift, expected.max_drift);
      EXPECT_GT(sum.filed, 500U);
      EXPECT_GT(sum.reachable - sum.filed, 200U);
    }
  }
  ASSERT_TRUE(limit_instruction_set(kNativeInstructionSet).ok());
}

}  // namespace
}  // namespace gridcast::tlas
