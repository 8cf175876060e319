// The walk over whole blocks, packed boxes, and rays from far away.

#include "core/tlas/uniform_grid.h"

#include <algorithm>
#include <map>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/tlas/grid_cost.h"
#include "core/tlas/grid_walk.h"
#include "tests/support/random.h"

namespace gridcast::tlas {
namespace {

GridLayout cube_grid(std::uint32_t n) {
  GridLayout layout;
  layout.bounds = {Vec3d(0.0), Vec3d(double(n))};
  for (std::uint32_t& cells : layout.cells) cells = n;
  layout.cell = layout.inverse_cell = Vec3d(1.0);
  layout.reach = 1e6 * n;
  layout.prepare();
  return layout;
}

Ray ray_of_pattern(int pattern, std::uint32_t n, test::Random& random) {
  Ray ray;
  const int kinds[3] = {pattern % 3, pattern / 3 % 3, pattern / 9};
  for (int axis = 0; axis < 3; ++axis) {
    const double zero = random.below(2) == 0 ? 0.0 : -0.0;
    ray.direction[axis] =
        kinds[axis] == 2 ? zero : (kinds[axis] == 0 ? 1.0 : -1.0) * random.uniform(0.01, 1.0);
    // On a plane, or anywhere.
    ray.origin[axis] = random.below(3) == 0 ? double(random.below(n + 1)) : random.uniform(0.0, n);
  }
  ray.tnear = random.below(2) == 0 ? 0.0 : -1e9;
  return ray;
}

std::vector<Cell> cells_of(const GridLayout& layout, const Ray& ray) {
  std::vector<Cell> cells;
  for (GridWalk walk(layout, WorldRay(ray), ray.tfar); !walk.done(); walk.step())
    cells.push_back(walk.cell());
  return cells;
}

/// Cells in which the ray certainly is at some t: the middles between its crossings of planes, where they are
/// farther from any plane than long double can be wrong.
std::vector<Cell> certain_cells(const GridLayout& layout, const Ray& ray) {
  const auto n = int(layout.cells[0]);
  std::vector<long double> crossings;
  for (int axis = 0; axis < 3; ++axis) {
    if (ray.direction[axis] == 0.0) continue;
    for (int k = 0; k <= n; ++k) {
      const long double t = (k - static_cast<long double>(ray.origin[axis])) / ray.direction[axis];
      if (t >= ray.tnear) crossings.push_back(t);
    }
  }
  crossings.push_back(std::max<long double>(ray.tnear, -4.0L * n * 200));
  std::sort(crossings.begin(), crossings.end());
  std::vector<Cell> cells;
  for (std::size_t i = 1; i < crossings.size(); ++i) {
    const long double t = (crossings[i - 1] + crossings[i]) / 2;
    Cell cell{};
    bool certain = true;
    for (int axis = 0; axis < 3; ++axis) {
      const long double x = ray.origin[axis] + t * ray.direction[axis];
      const long double inside = x - std::floor(x);
      certain = certain && x > 0 && x < n && inside > 0x1p-20L && inside < 1 - 0x1p-20L;
      cell[std::size_t(axis)] = std::uint16_t(certain ? int(x) : 0);
    }
    if (certain) cells.push_back(cell);
  }
  return cells;
}

TEST(GridWalk, visits_every_cell_that_the_ray_is_certainly_in_up_to_1024_cubed) {
  test::Random random(test::seed_or(41));
  for (const std::uint32_t n : {1U, 2U, 3U, 16U, 64U, 256U, 1024U}) {
    const GridLayout layout = cube_grid(n);
    for (int pattern = 0; pattern < 26; ++pattern) {
      for (int repeat = 0; repeat < 4; ++repeat) {
        const Ray ray = ray_of_pattern(pattern, n, random);
        std::vector<Cell> visited = cells_of(layout, ray);
        std::sort(visited.begin(), visited.end());
        for (const Cell& cell : certain_cells(layout, ray))
          ASSERT_TRUE(std::binary_search(visited.begin(), visited.end(), cell)) << n << " " << pattern;
      }
    }
  }
}

TEST(GridWalk, leaving_blocks_at_once_leads_to_the_cells_of_single_steps) {
  test::Random random(test::seed_or(42));
  for (const std::uint32_t n : {1U, 3U, 16U, 37U, 200U}) {
    const GridLayout layout = cube_grid(n);
    for (int pattern = 0; pattern < 26; ++pattern) {
      for (int repeat = 0; repeat < 8; ++repeat) {
        const Ray ray = ray_of_pattern(pattern, n, random);
        const std::vector<Cell> cells = cells_of(layout, ray);
        auto place = cells.begin();
        GridWalk walk(layout, WorldRay(ray), ray.tfar);
        while (!walk.done()) {
          ASSERT_NE(place, cells.end());
          ASSERT_EQ(walk.cell(), *place);
          const std::uint32_t block = walk.block();
          if (random.below(2) == 0) {
            walk.leave_block();
            while (place != cells.end() && layout.block_of((*place)[0], (*place)[1], (*place)[2]) == block)
              ++place;
          } else {
            walk.step();
            ++place;
          }
        }
        ASSERT_EQ(place, cells.end());
      }
    }
  }
}

/// Boxes in and around a crowd, some large, some of them without a size.
BoxTable crowd(std::size_t count, test::Random& random) {
  BoxTable boxes;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d center = random.in_box(i % 8 == 0 ? 10.0 : 0.5);
    const Vec3d half =
        i % 40 == 0 ? Vec3d(0.0) : std::exp2(random.uniform(-8.0, -1.0)) * Vec3d(1.0, 0.5, 0.7);
    boxes.push_back({{center - half, center + half}, i % 16 == 0 ? 0x1p-30F : 0x1p-38F});
  }
  return boxes;
}

GridLayout layout_of(const BoxTable& boxes) {
  return *choose_grid(sum_boxes(boxes), max_cells(boxes.size())).layout;
}

using Visits = std::map<std::uint32_t, int>;

template <class Traverse>
Visits visits_of(const Traverse& traverse) {
  Visits visits;
  const auto visit = [](const void* object, std::uint32_t id) {
    ++(*static_cast<Visits* const*>(object))->operator[](id);
    return std::numeric_limits<double>::infinity();
  };
  Visits* target = &visits;
  traverse(InstanceVisitor{&target, visit, [](const void*, std::uint32_t) {}});
  return visits;
}

Visits walk_visits(const UniformGrid& grid, const Ray& ray) {
  return visits_of([&](const InstanceVisitor& v) { grid.walk(WorldRay(ray), ray.tfar, v); });
}

/// Towards the corner of a box, so that the ray just touches it.
Ray ray_to_corner(const Bounds3d& box, double distance, test::Random& random) {
  const Vec3d corner{random.below(2) == 0 ? box.lower.x : box.upper.x,
                     random.below(2) == 0 ? box.lower.y : box.upper.y,
                     random.below(2) == 0 ? box.lower.z : box.upper.z};
  Vec3d direction = random.direction();
  if (random.below(3) == 0) direction[int(random.below(3))] = random.below(2) == 0 ? 0.0 : -0.0;
  return {corner - distance * direction, direction};
}

bool meets(const Bounds3d& box, const Ray& ray) {
  return !intersect_box(WorldRay(ray), box, 0.0, ray.tfar).empty();
}

TEST(UniformGrid, rays_that_touch_a_corner_of_a_box_visit_it_once_near_and_far) {
  test::Random random(test::seed_or(43));
  const BoxTable boxes = crowd(1500, random);
  const UniformGrid grid(layout_of(boxes), boxes);
  ASSERT_TRUE(grid.validate(boxes).ok());
  EXPECT_GT(grid.tree_count(), 0U);
  for (int i = 0; i < 600; ++i) {
    const double distance = i % 3 == 0 ? 1e9 : random.uniform(0.0, 40.0);
    const Ray ray = ray_to_corner(boxes[random.below(1500)].bounds, distance, random);
    const WorldRay world(ray);
    const bool near = world.distance_to(grid.layout().bounds) <= grid.layout().reach;
    std::vector<Visits> both{
        visits_of([&](const InstanceVisitor& v) { grid.search(world, ray.tfar, boxes, v); })};
    if (near) both.push_back(walk_visits(grid, ray));
    for (const Visits& visits : both) {
      for (const auto& [id, count] : visits) ASSERT_EQ(count, 1);
      for (std::uint32_t id = 0; id < boxes.size(); ++id)
        ASSERT_TRUE(visits.contains(id) || !meets(boxes[id].bounds, ray)) << id << " " << distance;
    }
  }
}

TEST(UniformGrid, with_less_room_around_the_boxes_than_proven_some_are_lost) {
  test::Random random(44);
  const BoxTable boxes = crowd(1500, random);
  GridLayout layout = layout_of(boxes);
  layout.outward = 0.0;
  layout.slack = -0x1p-12 * max_abs(layout.bounds.extent());
  const UniformGrid grid(layout, boxes);
  int lost = 0;
  for (int i = 0; i < 600; ++i) {
    const Ray ray = ray_to_corner(boxes[random.below(1500)].bounds, 5.0, random);
    const Visits visits = walk_visits(grid, ray);
    for (std::uint32_t id = 0; id < boxes.size(); ++id)
      lost += meets(boxes[id].bounds, ray) && !visits.contains(id) ? 1 : 0;
  }
  EXPECT_GT(lost, 0);
}

TEST(UniformGrid, an_updated_grid_visits_what_one_built_anew_visits) {
  test::Random random(test::seed_or(45));
  BoxTable boxes = crowd(800, random);
  const GridLayout layout = layout_of(boxes);
  UniformGrid updated(layout, boxes);
  for (int round = 0; round < 20; ++round) {
    BoxTable next = boxes;
    std::vector<RangeChange> changes;
    for (int k = 0; k < 15; ++k) {
      const auto id = std::uint32_t(round * 15 + k) % 800U;
      next.write(id) = {{random.in_box(4.0), {}}, 0x1p-38F};
      next.write(id).bounds.upper = next[id].bounds.lower + Vec3d(random.uniform(0.0, 1.0));
      if (random.below(5) == 0) next.write(id) = {};
      changes.push_back({id, layout.range_of(boxes[id]), layout.range_of(next[id])});
    }
    updated.apply(changes, next);
    boxes = next;
  }
  ASSERT_TRUE(updated.validate(boxes).ok());
  const UniformGrid fresh(layout, boxes);
  EXPECT_EQ(updated.reference_count(), fresh.reference_count());
  EXPECT_EQ(updated.memory_bytes(), fresh.memory_bytes());
  for (int i = 0; i < 200; ++i) {
    const Ray ray = ray_to_corner(fresh.layout().bounds, random.uniform(0.0, 9.0), random);
    EXPECT_EQ(walk_visits(updated, ray), walk_visits(fresh, ray));
  }
}

TEST(UniformGrid, an_update_makes_the_blocks_of_what_moved_and_no_others) {
  test::Random random(test::seed_or(46));
  const BoxTable boxes = crowd(3000, random);
  const GridLayout layout = layout_of(boxes);
  const UniformGrid before(layout, boxes);
  for (const std::uint32_t count : {1U, 10U, 40U}) {
    BoxTable moved = boxes;
    std::vector<RangeChange> changes;
    std::set<std::uint32_t> touched;
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t id = k * 70;
      moved.write(id).bounds = {boxes[id].bounds.lower + Vec3d(0.01), boxes[id].bounds.upper + Vec3d(0.01)};
      changes.push_back({id, layout.range_of(boxes[id]), layout.range_of(moved[id])});
      for (const CellRange& range : {changes.back().before, changes.back().after})
        range.for_each([&](const Cell& c) { touched.insert(layout.block_of(c[0], c[1], c[2])); });
    }
    UniformGrid after = before;
    after.apply(changes, moved);
    std::set<std::uint32_t> made;
    for (std::uint32_t b = 0; b < layout.block_count(); ++b)
      if (after.block(b) != before.block(b)) made.insert(b);
    EXPECT_EQ(made, touched);
    ASSERT_TRUE(after.validate(moved).ok());
    ASSERT_TRUE(before.validate(boxes).ok());
  }
}

}  // namespace
}  // namespace gridcast::tlas
