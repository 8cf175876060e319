// Blocks that are made when somebody first looks at them.

#include <atomic>
#include <map>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "core/tlas/grid_cost.h"
#include "core/tlas/top_level.h"
#include "tests/support/random.h"

namespace gridcast::tlas {
namespace {

InstanceBox cube(const Vec3d& center, double half) {
  return {{center - Vec3d(half), center + Vec3d(half)}, 0x1p-38F};
}

/// A crowd in the middle of a cloud.
BoxTable crowd(std::size_t count, test::Random& random) {
  BoxTable boxes;
  for (std::size_t i = 0; i < count; ++i)
    boxes.push_back(cube(random.in_box(i % 3 == 0 ? 0.3 : 10.0), std::exp2(random.uniform(-5.0, -2.0))));
  return boxes;
}

GridLayout layout_of(const BoxTable& boxes) {
  return *choose_grid(sum_boxes(boxes), max_cells(boxes.size()), kRoomToMove).layout;
}

Ray ray_through(const Bounds3d& bounds, test::Random& random) {
  const Vec3d origin = bounds.center() + max_abs(bounds.extent()) * random.in_box(1.0);
  const Vec3d target = bounds.center() + 0.3 * random.in_box(1.0) * bounds.extent();
  return {origin, target - origin};
}

std::vector<std::uint32_t> walk(const UniformGrid& grid, const Ray& ray) {
  std::vector<std::uint32_t> visited;
  const auto visit = [](const void* object, std::uint32_t id) {
    (*static_cast<std::vector<std::uint32_t>* const*>(object))->push_back(id);
    return std::numeric_limits<double>::infinity();
  };
  std::vector<std::uint32_t>* const target = &visited;
  grid.walk(WorldRay(ray), ray.tfar, {&target, visit, [](const void*, std::uint32_t) {}});
  return visited;
}

TEST(LateBlocks, a_walk_makes_the_blocks_it_comes_to_and_visits_what_it_would_in_a_whole_grid) {
  test::Random random(test::seed_or(161));
  const BoxTable boxes = crowd(3000, random);
  const GridLayout layout = layout_of(boxes);
  const UniformGrid whole(layout, boxes), late(layout, boxes, MakeBlocks::kWhenAsked);
  EXPECT_EQ(late.block_bytes(), 0U);
  std::size_t before = 0;
  for (int i = 0; i < 40; ++i) {
    const Ray ray = ray_through(layout.bounds, random);
    ASSERT_EQ(walk(late, ray), walk(whole, ray));
    if (i == 0) {
      before = late.block_bytes();
      EXPECT_GT(before, 0U);
      EXPECT_LT(before, whole.block_bytes());
    }
  }
  EXPECT_TRUE(late.validate(boxes).ok());
  EXPECT_EQ(late.block_bytes(), whole.block_bytes());
  EXPECT_EQ(late.reference_count(), whole.reference_count());
  EXPECT_EQ(late.tree_count(), whole.tree_count());
  EXPECT_GT(late.tree_count(), 0U);
}

TEST(LateBlocks, many_threads_that_ask_at_once_get_one_block) {
  test::Random random(test::seed_or(162));
  const BoxTable boxes = crowd(4000, random);
  const GridLayout layout = layout_of(boxes);
  const std::size_t expected = UniformGrid(layout, boxes).block_bytes();
  for (int round = 0; round < 5; ++round) {
    const UniformGrid grid(layout, boxes, MakeBlocks::kWhenAsked);
    constexpr std::size_t kThreads = 8;
    std::vector<std::vector<const GridBlock*>> found(kThreads);
    std::atomic<std::size_t> waiting = kThreads;
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < kThreads; ++t)
      threads.emplace_back([&, t] {
        for (--waiting; waiting != 0;) std::this_thread::yield();
        for (std::uint32_t b = 0; b < layout.block_count(); ++b) found[t].push_back(grid.block(b));
      });
    for (std::thread& thread : threads) thread.join();
    for (const auto& blocks : found) EXPECT_EQ(blocks, found[0]);
    EXPECT_EQ(grid.block_bytes(), expected) << "each was made once";
  }
}

TEST(LateBlocks, an_edit_of_blocks_that_nobody_has_looked_at_is_that_of_a_whole_grid) {
  test::Random random(test::seed_or(163));
  const BoxTable boxes = crowd(2000, random);
  const GridLayout layout = layout_of(boxes);
  const UniformGrid before(layout, boxes, MakeBlocks::kWhenAsked);
  static_cast<void>(walk(before, ray_through(layout.bounds, random)));  // some are made
  UniformGrid after = before;
  BoxTable moved = boxes;
  std::vector<RangeChange> changes;
  for (std::uint32_t id = 0; id < 2000; id += 40) {
    moved.write(id) = id % 80 == 0 ? InstanceBox{} : cube(random.in_box(9.0), 0.1);
    changes.push_back({id, layout.range_of(boxes[id]), layout.range_of(moved[id])});
  }
  after.apply(changes, moved);
  const UniformGrid fresh(layout, moved);
  for (int i = 0; i < 40; ++i) {
    const Ray ray = ray_through(layout.bounds, random);
    ASSERT_EQ(walk(after, ray), walk(fresh, ray));
  }
  EXPECT_TRUE(after.validate(moved).ok());
  EXPECT_TRUE(before.validate(boxes).ok());
  EXPECT_EQ(after.reference_count(), fresh.reference_count());
}

TEST(LateBlocks, the_largest_are_made_in_advance) {
  test::Random random(test::seed_or(166));
  BoxTable boxes;
  for (int i = 0; i < 20000; ++i) boxes.push_back(cube(random.in_box(i % 100 == 0 ? 10.0 : 0.2), 0.05));
  GridLayout layout = layout_of(boxes);
  for (std::uint32_t& cells : layout.cells) cells = 9;
  layout.cell = layout.bounds.extent() / 9.0;
  layout.inverse_cell = 9.0 / layout.bounds.extent();
  layout.prepare();
  const UniformGrid late(layout, boxes, MakeBlocks::kWhenAsked), whole(layout, boxes);
  EXPECT_GT(2 * late.block_bytes(), whole.block_bytes());
  EXPECT_LT(late.block_bytes(), whole.block_bytes());
  EXPECT_TRUE(late.validate(boxes).ok());
}

/// All boxes as `place` has them.
TopLevel moved(TopLevel level, const auto& place) {
  BoxTable boxes = level.boxes();
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 0; id < boxes.size(); ++id) {
    boxes.write(id) = place(id, boxes[id]);
    ids.push_back(id);
  }
  level.update(std::move(boxes), ids);
  return level;
}

TEST(LateBlocks, a_scene_whose_instances_all_move_keeps_its_layout_until_they_are_spread_otherwise) {
  test::Random random(test::seed_or(164));
  const auto shake = [&](std::uint32_t /*id*/, const InstanceBox& box) {
    return cube(box.bounds.center() + random.in_box(0.01), 0.5 * box.bounds.extent().x);
  };
  TopLevel level = moved(TopLevel::build(crowd(3000, random)), shake);  // chosen anew, with room
  const Bounds3d frame = level.stats().bounds;
  for (int round = 0; round < 10; ++round) {
    level = moved(std::move(level), shake);
    ASSERT_EQ(level.stats().bounds, frame);
    ASSERT_TRUE(level.validate().ok());
  }
  const auto apart = [](std::uint32_t, const InstanceBox& box) {
    return cube(8.0 * box.bounds.center(), 0.1);
  };
  const auto together = [](std::uint32_t, const InstanceBox& box) {
    return cube(box.bounds.center() / 8.0, 0.1);
  };
  const auto larger = [](std::uint32_t, const InstanceBox& box) { return cube(box.bounds.center(), 0.6); };
  const auto crowded = [](std::uint32_t id, const InstanceBox& box) {
    return id % 50 == 0 ? box : cube(Vec3d(0.01 * (id % 100)), 0.1);
  };
  EXPECT_NE(moved(level, apart).stats().bounds, frame);
  EXPECT_NE(moved(level, together).stats().bounds, frame);
  EXPECT_NE(moved(level, larger).stats().bounds, frame);
  EXPECT_NE(moved(level, crowded).stats().bounds, frame);
  for (const TopLevel& other : {moved(level, apart), moved(level, together), moved(level, larger)})
    EXPECT_TRUE(other.validate().ok());
}

TEST(LateBlocks, a_flat_scene_gets_its_room_without_more_or_fewer_cells) {
  test::Random random(test::seed_or(165));
  BoxTable boxes;
  for (int i = 0; i < 3000; ++i)
    boxes.push_back(
        cube({random.uniform(-50.0, 50.0), random.uniform(-0.1, 0.1), random.uniform(-50.0, 50.0)}, 0.5));
  const BoxSums sums = sum_boxes(boxes);
  const GridLayout plain = *choose_grid(sums, max_cells(3000)).layout;
  const GridLayout roomy = *choose_grid(sums, max_cells(3000), 0.5).layout;
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(roomy.cells[axis], plain.cells[axis]);
    EXPECT_NEAR(roomy.bounds.extent()[axis], plain.bounds.extent()[axis] + 1.0, 1e-9);
    EXPECT_NEAR(roomy.cell[axis] * roomy.cells[axis], roomy.bounds.extent()[axis], 1e-9);
  }
  EXPECT_EQ(plain.cells[1], 1U);
}

}  // namespace
}  // namespace gridcast::tlas
