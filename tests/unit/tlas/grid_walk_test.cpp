#include "core/tlas/grid_walk.h"

#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace gridcast::tlas {
namespace {

GridLayout cube_grid(std::uint32_t n, const Vec3d& lower, double size) {
  GridLayout layout;
  layout.bounds = {lower, lower + Vec3d(size)};
  for (int axis = 0; axis < 3; ++axis) {
    layout.cells[axis] = n;
    layout.cell[axis] = size / n;
    layout.inverse_cell[axis] = n / size;
  }
  layout.reach = 1e6 * size;
  layout.prepare();
  return layout;
}

/// Length of t that the ray spends inside the cell shrunk by `margin`, in long double; negative for a miss.
long double chord(const GridLayout& layout, const Cell& cell, const Ray& ray, long double margin) {
  long double enter = ray.tnear, exit = ray.tfar;
  for (int axis = 0; axis < 3; ++axis) {
    const long double k = cell[std::size_t(axis)];
    const long double low = layout.bounds.lower[axis] + k * layout.cell[axis] + margin;
    const long double high = layout.bounds.lower[axis] + (k + 1) * layout.cell[axis] - margin;
    const long double o = ray.origin[axis], d = ray.direction[axis];
    if (d == 0) {
      if (o < low || o > high) return -1;
      continue;
    }
    enter = std::max(enter, std::min((low - o) / d, (high - o) / d));
    exit = std::min(exit, std::max((low - o) / d, (high - o) / d));
  }
  return exit - enter;
}

/// Walks, checks what every walk promises, and returns the visited cells.
std::set<Cell> walk_checked(const GridLayout& layout, const Ray& ray) {
  const WorldRay world(ray);
  GridWalk walk(layout, world, ray.tfar);
  std::set<Cell> visited;
  Cell before{};
  double before_exit = 0.0;
  std::size_t steps = 0;
  for (; !walk.done(); walk.step()) {
    const Cell cell = walk.cell();
    const std::size_t most = layout.cells[0] + layout.cells[1] + layout.cells[2] - 2;
    if (++steps > most) {
      ADD_FAILURE() << "the walk does not end";
      break;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_LT(cell[axis], layout.cells[axis]);
    EXPECT_LE(walk.t_enter(), walk.t_exit());
    EXPECT_EQ(walk.from() == 6, steps == 1);
    if (steps > 1) {
      EXPECT_EQ(walk.t_enter(), before_exit);
      Cell expected = cell;
      expected[std::size_t(walk.from() / 2)] += std::uint16_t(walk.from() % 2 == 0 ? -1 : 1);
      EXPECT_EQ(expected, before);
    }
    EXPECT_TRUE(visited.insert(cell).second) << "a cell is visited twice";
    before = cell;
    before_exit = walk.t_exit();
  }
  return visited;
}

/// Every cell with a chord is visited, and every visited one is touched, up to the rounding slack.
void expect_exact_cells(const GridLayout& layout, const Ray& ray) {
  const std::set<Cell> visited = walk_checked(layout, ray);
  const WorldRay world(ray);
  const long double slack = rounding_slack(world.distance_to(layout.bounds), layout.bounds);
  CellRange all;
  all.lower = {0, 0, 0};
  for (std::size_t axis = 0; axis < 3; ++axis) all.upper[axis] = std::uint16_t(layout.cells[axis] - 1);
  all.for_each([&](const Cell& cell) {
    const bool was_visited = visited.contains(cell);
    if (chord(layout, cell, ray, slack) > 0) {
      EXPECT_TRUE(was_visited);
    }
    if (was_visited) {
      EXPECT_GE(chord(layout, cell, ray, -slack), 0);
    }
  });
}

double signed_component(int kind, test::Random& random) {
  switch (kind) {
    case 0:
      return random.uniform(0.1, 1.0);
    case 1:
      return random.uniform(-1.0, -0.1);
    default:
      return random.below(2) == 0 ? 0.0 : -0.0;
  }
}

TEST(GridWalk, visits_exactly_the_cells_of_the_chord_for_all_sign_patterns_and_origins_on_planes) {
  test::Random random(test::seed_or(11));
  for (const std::uint32_t n : {1U, 2U, 3U, 16U}) {
    for (const double offset : {0.0, 1.0e6}) {
      const GridLayout layout = cube_grid(n, Vec3d(offset, -offset, 0.25 * offset), 8.0);
      for (int pattern = 0; pattern < 26; ++pattern) {
        for (int repeat = 0; repeat < 12; ++repeat) {
          Ray ray;
          const int kinds[3] = {pattern % 3, pattern / 3 % 3, pattern / 9};
          for (int axis = 0; axis < 3; ++axis) {
            ray.direction[axis] = signed_component(kinds[axis], random);
            // On a plane (the last one included), inside a cell, or outside on either side.
            const double k = random.below(n + 1), inside = random.uniform(0.0, double(n));
            const double outside = random.below(2) == 0 ? -1.5 : n + 1.5;
            const double where =
                repeat % 3 == 0 ? k : (repeat % 3 == 1 || kinds[axis] == 2 ? inside : outside);
            ray.origin[axis] = layout.bounds.lower[axis] + where * layout.cell[axis];
          }
          if (repeat % 4 == 3) ray.tnear = random.uniform(-4.0, 4.0);
          if (repeat % 4 == 2) ray.tfar = random.uniform(0.0, 20.0);
          expect_exact_cells(layout, ray);
        }
      }
    }
  }
}

TEST(GridWalk, visits_exactly_the_cells_of_the_chord_in_64_cubed_cells) {
  test::Random random(test::seed_or(12));
  const GridLayout layout = cube_grid(64, Vec3d(-3.0, 17.0, 0.1), 1.0);
  for (int i = 0; i < 12; ++i) {
    const Vec3d target = layout.bounds.center() + random.in_box(0.5);
    const Vec3d origin = layout.bounds.center() + random.in_box(1.5);
    expect_exact_cells(layout, {origin, target - origin, 0.0, 5.0});
  }
}

TEST(GridWalk, diagonals_through_lattice_points_take_no_cell_twice_and_end) {
  for (const std::uint32_t n : {1U, 2U, 3U, 16U, 64U, 1000U}) {
    const GridLayout layout = cube_grid(n, Vec3d(0.0), n * 0.1);
    for (int pattern = 0; pattern < 27; ++pattern) {
      const Vec3d d{pattern % 3 - 1.0, pattern / 3 % 3 - 1.0, pattern / 9 - 1.0};
      if (max_abs(d) == 0.0) continue;
      for (const double k : {0.0, 0.5, 1.0, 0.5 * n, 1.0 * n}) {
        const std::set<Cell> visited = walk_checked(layout, {Vec3d(k * 0.1), d, -1e9});
        EXPECT_GE(visited.size(), 1U);
      }
    }
  }
}

TEST(GridWalk, a_ray_that_misses_or_ends_before_the_grid_visits_nothing) {
  const GridLayout layout = cube_grid(4, Vec3d(0.0), 1.0);
  EXPECT_TRUE(walk_checked(layout, {{-1, 2, 0.5}, {1, 0, 0}}).empty());
  EXPECT_TRUE(walk_checked(layout, {{2, 0.5, 0.5}, {1, 0, 0}}).empty());
  EXPECT_TRUE(walk_checked(layout, {{-1, 0.5, 0.5}, {1, 0, 0}, 0.0, 0.5}).empty());
  EXPECT_TRUE(walk_checked(layout, {{-1, 0.5, 0.5}, {1, 0, 0}, 3.0, 1.0}).empty());
  EXPECT_EQ(walk_checked(layout, {{2, 0.6, 0.6}, {-1, -0.0, 0.0}}).size(), 4U);
}

TEST(GridWalk, tiny_and_huge_directions_walk_like_ordinary_ones) {
  const GridLayout layout = cube_grid(8, Vec3d(-1.0), 2.0);
  const auto expected = walk_checked(layout, {{-2, -0.3, 0.2}, {1, 0.25, 0.125}});
  for (const double scale : {0x1p-199, 0x1p-60, 0x1p60, 0x1p199}) {
    EXPECT_EQ(walk_checked(layout, {{-2, -0.3, 0.2}, scale * Vec3d(1, 0.25, 0.125)}), expected);
  }
  // A component too small to matter: 1 / component would overflow.
  EXPECT_EQ(walk_checked(layout, {{-2, -0.3, 0.2}, {1, 5e-324, -1e-310}}).size(), 8U);
}

}  // namespace
}  // namespace gridcast::tlas
