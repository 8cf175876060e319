// Records of boxes as they are filed, made many at once.

#include "core/tlas/box_filing.h"

#include <bit>
#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"
#include "core/tlas/grid_cost.h"
#include "tests/support/random.h"

namespace gridcast::tlas {
namespace {

std::vector<InstanceBox> awkward_boxes(std::size_t count, test::Random& random) {
  std::vector<InstanceBox> boxes(count);
  for (InstanceBox& box : boxes) {
    const std::uint32_t kind = random.below(10);
    if (kind == 0) continue;                                    // empty
    const Vec3d at = random.in_box(kind == 1 ? 300.0 : 100.0);  // some leave the grid
    const Vec3d half = random.in_box(std::exp2(random.uniform(-20.0, 5.0)));
    box.bounds.extend(at - glm::abs(half));
    box.bounds.extend(at + glm::abs(half));
    box.drift = kind == 2 ? 1e-3F : float(random.uniform(0.0, 1e-12));
    if (kind == 3) box.bounds.lower.y = box.bounds.upper.y = 0.0;
    if (kind == 4) std::swap(box.bounds.lower.z, box.bounds.upper.z);  // empty along one axis alone
  }
  return boxes;
}

GridLayout layout_of_a_grid(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  GridLayout layout;
  layout.bounds = {Vec3d(-120.0, -110.0, -130.0), Vec3d(125.0, 115.0, 105.0)};
  const std::uint32_t cells[3] = {x, y, z};
  for (int axis = 0; axis < 3; ++axis) {
    layout.cells[axis] = cells[axis];
    layout.cell[axis] = layout.bounds.extent()[axis] / cells[axis];
    layout.inverse_cell[axis] = cells[axis] / layout.bounds.extent()[axis];
  }
  layout.reach = 1e6;
  layout.prepare();
  return layout;
}

/// Ids in an order that jumps about, some of them twice.
std::vector<std::uint32_t> some_ids(std::size_t count, test::Random& random) {
  std::vector<std::uint32_t> ids(count);
  for (std::uint32_t& id : ids) id = random.below(std::uint32_t(count));
  return ids;
}

TEST(BoxFiling, ranges_and_records_are_those_of_the_layout_bit_for_bit_with_every_instruction_set) {
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
      std::vector<PackedRange> ranges(boxes.size());
      Bounds3d bounds, expected_bounds;
      filing.find_ranges(boxes, ranges.data(), bounds);
      const std::vector<std::uint32_t> ids = some_ids(boxes.size(), random);
      std::vector<BoxRecord> records(ids.size());
      filing.make_records(table, ids, records.data());
      std::size_t filed = 0, left_out = 0;
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        const CellRange range = layout.range_of(boxes[i]);
        ASSERT_EQ(std::bit_cast<CellRange>(ranges[i]), range) << i;
        if (!boxes[i].bounds.empty()) expected_bounds.extend(boxes[i].bounds);
        (range.empty() ? left_out : filed)++;
        const InstanceBox& box = boxes[ids[i]];
        ASSERT_EQ(records[i].instance_id, ids[i]);
        ASSERT_EQ(records[i].range, layout.range_of(box)) << i;
        if (records[i].range.empty()) continue;
        const Bounds3f local = layout.local_box(layout.grown(box));
        ASSERT_EQ(std::memcmp(&records[i].box, &local, sizeof local), 0) << i;
      }
      EXPECT_EQ(bounds, expected_bounds);
      EXPECT_GT(filed, 500U);
      EXPECT_GT(left_out, 500U);
    }
  }
  ASSERT_TRUE(limit_instruction_set(kNativeInstructionSet).ok());
}

}  // namespace
}  // namespace gridcast::tlas
