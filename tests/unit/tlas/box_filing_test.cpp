// Records of boxes as they are filed, made many at once.

#include "core/tlas/box_filing.h"

#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"
#include "tests/unit/tlas/filing_fixture.h"

namespace gridcast::tlas {
namespace {

/// Ids in an order that jumps about, some of them twice.
std::vector<std::uint32_t> some_ids(std::size_t count, test::Random& random) {
  std::vector<std::uint32_t> ids(count);
  for (std::uint32_t& id : ids) id = random.below(std::uint32_t(count));
  return ids;
}

TEST(BoxFiling, records_are_those_of_the_layout_bit_for_bit_with_every_instruction_set) {
  test::Random random(test::seed_or(141));
  for (const std::string_view isa : instruction_sets()) {
    SCOPED_TRACE(isa);
    ASSERT_TRUE(limit_instruction_set(isa).ok());
    for (const GridLayout& layout : {layout_of_a_grid(16, 16, 16), layout_of_a_grid(1, 1, 1),
                                     layout_of_a_grid(65535, 1, 3), layout_of_a_grid(7, 500, 2)}) {
      const std::vector<InstanceBox> boxes = awkward_boxes(3000, random);
      BoxTable table;
      for (const InstanceBox& box : boxes) table.push_back(box);
      const BoxFiling filing(layout);
      const std::vector<std::uint32_t> ids = some_ids(boxes.size(), random);
      std::vector<BoxRecord> records(ids.size());
      filing.make_records(table, ids, records.data());
      std::size_t filed = 0, left_out = 0;
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        const InstanceBox& box = boxes[ids[i]];
        (layout.range_of(box).empty() ? left_out : filed)++;
        ASSERT_EQ(records[i].instance_id, ids[i]);
        ASSERT_EQ(records[i].range, layout.range_of(box)) << i;
        if (records[i].range.empty()) continue;
        const Bounds3f local = layout.local_box(layout.grown(box));
        ASSERT_EQ(std::memcmp(&records[i].box, &local, sizeof local), 0) << i;
      }
      EXPECT_GT(filed, 500U);
      EXPECT_GT(left_out, 500U);
    }
  }
  ASSERT_TRUE(limit_instruction_set(kNativeInstructionSet).ok());
}

}  // namespace
}  // namespace gridcast::tlas
