#include "core/tlas/top_level.h"

#include <functional>
#include <map>
#include <set>
#include <utility>

#include <gtest/gtest.h>

#include "core/tlas/grid_cost.h"
#include "tests/support/random.h"

namespace gridcast::tlas {
namespace {

using Boxes = std::vector<InstanceBox>;

InstanceBox cube(const Vec3d& center, double half, float drift = 0x1p-38F) {
  return {{center - Vec3d(half), center + Vec3d(half)}, drift};
}

Boxes cloud(std::size_t count, test::Random& random) {
  Boxes boxes;
  for (std::size_t i = 0; i < count; ++i)
    boxes.push_back(cube(random.in_box(10.0), std::exp2(random.uniform(-5.0, 0.0))));
  return boxes;
}

BoxTable table_of(const Boxes& boxes) {
  BoxTable table;
  for (const InstanceBox& box : boxes) table.push_back(box);
  return table;
}

/// `level` over these boxes, of which only those of `changed` differ from what it has.
TopLevel updated(TopLevel level, const Boxes& boxes, const std::vector<std::uint32_t>& changed) {
  BoxTable table = level.boxes();
  table.grow(boxes.size());
  for (const std::uint32_t id : changed) table.write(id) = boxes[id];
  level.update(std::move(table), changed);
  return level;
}

/// Awkward arrangements, by name.
std::map<std::string, Boxes> arrangements() {
  test::Random random(21);
  std::map<std::string, Boxes> all;
  all["cloud"] = cloud(2000, random);
  for (int i = 0; i < 3000; ++i) {
    all["flat city"].push_back(cube({random.uniform(-500, 500), 0.0, random.uniform(-500, 500)}, 2.0));
    all["line"].push_back(cube({double(i), 0.0, 0.0}, 0.3));
    all["coincident"].push_back(cube(Vec3d(1.0), 1.0));
    all["giant and tiny"].push_back(i == 0 ? cube(Vec3d(0.0), 100.0) : cube(random.in_box(100.0), 0.01));
    const bool crowded = i % 100 != 0;
    all["stadium"].push_back(cube(random.in_box(crowded ? 0.5 : 500.0), 0.02));
    all["nested"].push_back(cube(Vec3d(0.0), 1.0 + i));
    all["far off"].push_back(cube(Vec3d(1e6) + random.in_box(1.0), 0.02));
    all["points"].push_back(cube(random.in_box(1.0), 0.0));
    all["some without a box"].push_back(i % 3 == 0 ? InstanceBox{} : cube(random.in_box(5.0), 0.1));
    all["some with much drift"].push_back(cube(random.in_box(5.0), 0.1, i % 50 == 0 ? 0.01F : 0x1p-38F));
  }
  return all;
}

Ray random_ray(const Bounds3d& bounds, test::Random& random) {
  const double size = max_abs(bounds.extent()) + 1e-3;
  const Vec3d target = bounds.center() + 0.5 * random.in_box(1.0) * bounds.extent();
  const Vec3d origin =
      random.below(4) == 0 ? target + random.in_box(size) : bounds.center() + 1.5 * random.in_box(size);
  Ray ray{origin, target - origin};
  if (max_abs(ray.direction) == 0.0) ray.direction = Vec3d(1, 0, 0);
  if (random.below(4) == 0) ray.direction[int(random.below(3))] = 0.0;
  if (max_abs(ray.direction) == 0.0) ray.direction = Vec3d(0, 1, 0);
  return ray;
}

/// Each visited instance and how often.
std::map<std::uint32_t, int> visits(const TopLevel& level, const Ray& ray) {
  std::map<std::uint32_t, int> counts;
  level.traverse(ray, ray.tfar, [&](std::uint32_t id) {
    ++counts[id];
    return ray.tfar;
  });
  return counts;
}

/// Boxes the ray truly meets, with nothing added.
std::vector<std::uint32_t> met(const Boxes& boxes, const Ray& ray) {
  std::vector<std::uint32_t> ids;
  for (std::uint32_t id = 0; id < boxes.size(); ++id) {
    const Bounds3d& box = boxes[id].bounds;
    if (!box.empty() && !intersect_box(WorldRay(ray), box, 0.0, ray.tfar).empty()) ids.push_back(id);
  }
  return ids;
}

void expect_every_met_box_visited_once(const TopLevel& level, const Boxes& boxes, test::Random& random,
                                       int rays) {
  for (int i = 0; i < rays; ++i) {
    const Ray ray = random_ray(level.bounds(), random);
    const auto counts = visits(level, ray);
    for (const auto& [id, count] : counts) EXPECT_EQ(count, 1) << id;
    for (const std::uint32_t id : met(boxes, ray)) EXPECT_TRUE(counts.contains(id)) << id;
  }
}

TEST(TopLevel, every_box_that_a_ray_meets_is_visited_once_in_awkward_scenes) {
  test::Random random(test::seed_or(22));
  for (const auto& [name, boxes] : arrangements()) {
    SCOPED_TRACE(name);
    const TopLevel level = TopLevel::build(boxes);
    const Status valid = level.validate();
    EXPECT_TRUE(valid.ok()) << valid.error().message << valid.error().where;
    expect_every_met_box_visited_once(level, boxes, random, 100);
  }
}

TEST(TopLevel, memory_stays_within_the_stated_bounds) {
  for (const auto& [name, boxes] : arrangements()) {
    SCOPED_TRACE(name);
    const TopLevelStats stats = TopLevel::build(boxes).stats();
    EXPECT_LE(stats.cell_count, max_cells(stats.instance_count));
    EXPECT_LE(stats.memory_bytes, 64 * boxes.size() + 32768 + max_bytes(stats.instance_count));
    EXPECT_FALSE(stats.reason.empty());
  }
}

TEST(TopLevel, the_cost_model_makes_no_grid_for_one_instance_or_a_heap) {
  auto all = arrangements();
  EXPECT_EQ(TopLevel::build(Boxes{}).kind(), TopLevelKind::kNone);
  EXPECT_EQ(TopLevel::build(Boxes{cube(Vec3d(3.0), 1.0)}).kind(), TopLevelKind::kNone);
  EXPECT_EQ(TopLevel::build(all["coincident"]).kind(), TopLevelKind::kOneLevel);
  EXPECT_GT(TopLevel::build(all["cloud"]).stats().cell_count, 100U);
  EXPECT_EQ(TopLevel::build(all["stadium"]).kind(), TopLevelKind::kNestedGrid);
  EXPECT_EQ(TopLevel::build(all["cloud"], TopLevelChoice::kNone).kind(), TopLevelKind::kNone);
  const TopLevelStats city = TopLevel::build(all["flat city"]).stats();
  EXPECT_EQ(city.cells[1], 1U);
  const TopLevelStats line = TopLevel::build(all["line"]).stats();
  EXPECT_GT(line.cells[0], 1000U);
  EXPECT_LE(line.cells[1] * line.cells[2], 4U);
}

TEST(TopLevel, rays_from_beyond_the_reach_visit_what_they_meet) {
  test::Random random(test::seed_or(23));
  const Boxes boxes = cloud(500, random);
  const TopLevel level = TopLevel::build(boxes);
  ASSERT_GT(level.stats().cell_count, 1U);
  for (int i = 0; i < 50; ++i) {
    const Vec3d target = random.in_box(10.0);
    const Vec3d origin = target + 1e9 * random.direction();
    const Ray ray{origin, target - origin};
    const auto counts = visits(level, ray);
    for (const std::uint32_t id : met(boxes, ray)) EXPECT_TRUE(counts.contains(id));
  }
}

TEST(TopLevel, a_walk_ends_when_the_best_hit_lies_within_the_cell) {
  Boxes boxes;
  for (int i = 0; i < 1000; ++i) boxes.push_back(cube({double(i), 0.0, 0.0}, 0.4));
  const TopLevel level = TopLevel::build(boxes);
  ASSERT_GT(level.stats().cell_count, 1U);
  int count = 0;
  level.traverse({{-10, 0, 0}, {1, 0, 0}}, 1e9, [&](std::uint32_t id) {
    ++count;
    return 10.0 + id - 0.4;  // the near face of the box
  });
  EXPECT_LE(count, 4);
  level.traverse({{-10, 0, 0}, {1, 0, 0}}, 1e9, [&](std::uint32_t) {
    count = -1;
    return -std::numeric_limits<double>::infinity();
  });
  EXPECT_EQ(count, -1);
}

TEST(TopLevelUpdate, random_inserts_moves_and_erasures_keep_it_sound_and_leave_old_copies_alone) {
  test::Random random(test::seed_or(24));
  Boxes boxes = cloud(600, random);
  TopLevel level = TopLevel::build(boxes);
  for (int round = 0; round < 60; ++round) {
    const TopLevel old = level;
    const Boxes old_boxes = boxes;
    std::set<std::uint32_t> changes;
    for (std::uint32_t k = 0; k < 1 + random.below(20); ++k) {
      const auto id = random.below(std::uint32_t(boxes.size()) + 2);
      const double spread = random.below(10) == 0 ? 40.0 : 10.0;  // now and then out of the grid
      if (id >= boxes.size()) boxes.resize(id + 1);
      boxes[id] =
          random.below(5) == 0 ? InstanceBox{} : cube(random.in_box(spread), random.uniform(0.0, 1.0));
      changes.insert(id);
    }
    level = updated(old, boxes, {changes.begin(), changes.end()});
    ASSERT_EQ(level.slots(), boxes.size());
    for (std::uint32_t id = 0; id < boxes.size(); ++id) ASSERT_EQ(level.box(id), boxes[id]);
    for (const TopLevel* each : {&std::as_const(level), &old}) {
      const Status valid = each->validate();
      ASSERT_TRUE(valid.ok()) << valid.error().message << valid.error().where;
    }
    expect_every_met_box_visited_once(level, boxes, random, 10);
    expect_every_met_box_visited_once(old, old_boxes, random, 3);
  }
}

TEST(TopLevelUpdate, an_instance_that_flies_away_does_not_slow_the_grid_and_is_still_visited) {
  test::Random random(test::seed_or(25));
  Boxes boxes = cloud(2000, random);
  const TopLevel built = TopLevel::build(boxes);
  boxes[7] = cube(Vec3d(1e8), 1.0);
  const TopLevel level = updated(built, boxes, {7});
  EXPECT_GT(level.stats().cell_count, 100U);
  EXPECT_EQ(level.stats().always_tested, 1U);
  EXPECT_TRUE(visits(level, {Vec3d(0.0), Vec3d(1.0)}).contains(7));
}

/// After many small updates a ray costs at most twice what it does in a top level built anew, by the cost
/// model and what the cells really hold.
void expect_follows(const TopLevel& level, const Boxes& boxes) {
  const Status valid = level.validate();
  ASSERT_TRUE(valid.ok()) << valid.error().message << valid.error().where;
  const TopLevelStats fresh = TopLevel::build(boxes).stats(), drifted = level.stats();
  EXPECT_LE(drifted.ray_cost, 2.0 * fresh.ray_cost);
  EXPECT_LE(drifted.always_tested, fresh.always_tested + 17U);
}

TEST(TopLevelUpdate, the_resolution_follows_where_a_thousand_small_updates_carry_the_instances) {
  test::Random random(test::seed_or(27));
  constexpr std::uint32_t kCount = 4000, kMoved = 8, kUpdates = 1000;
  const auto into_a_corner = [](const Vec3d& at) { return Vec3d(-9.9) + 0.01 * at; };
  const auto apart = [](const Vec3d& at) { return 100.0 * at; };
  const auto in_place = [](const Vec3d& at) { return at + Vec3d(0.01); };
  const std::pair<const char*, std::function<Vec3d(const Vec3d&)>> drifts[] = {
      {"into a corner", into_a_corner}, {"apart", apart}, {"in place", in_place}};
  for (const auto& [name, drift] : drifts) {
    SCOPED_TRACE(name);
    Boxes boxes;
    for (std::uint32_t i = 0; i < kCount; ++i) boxes.push_back(cube(random.in_box(10.0), 0.02));
    TopLevel level = TopLevel::build(boxes);
    for (std::uint32_t k = 0; k < kUpdates; ++k) {
      std::vector<std::uint32_t> moved;
      for (std::uint32_t j = 0; j < kMoved; ++j) moved.push_back((k * kMoved + j) % kCount);
      for (const std::uint32_t id : moved) boxes[id] = cube(drift(boxes[id].bounds.center()), 0.02);
      level = updated(std::move(level), boxes, moved);
      if (k % 125 == 124) {
        ASSERT_NO_FATAL_FAILURE(expect_follows(level, boxes)) << k;
      }
    }
  }
}

TEST(TopLevelUpdate, the_resolution_follows_when_the_few_that_stood_far_off_come_in) {
  test::Random random(test::seed_or(28));
  Boxes boxes;
  for (std::uint32_t i = 0; i < 4000; ++i)
    boxes.push_back(cube(random.in_box(i % 100 == 0 ? 30.0 : 1.0), 0.01));
  TopLevel level = TopLevel::build(boxes);
  const auto move = [&](std::uint32_t id) {
    boxes[id] = cube(random.in_box(1.0), 0.01);
    level = updated(std::move(level), boxes, {id});
  };
  for (std::uint32_t id = 0; id < 4000; id += 100) move(id);
  for (std::uint32_t id = 1; id <= 4000 / 128 + 1; ++id) move(id);  // until it is looked at
  expect_follows(level, boxes);
  const Vec3d extent = level.stats().bounds.extent();
  EXPECT_LT(max_abs(extent), 5.0);
}

TEST(TopLevelValidate, a_grid_that_forgets_an_edit_is_caught) {
  test::Random random(test::seed_or(26));
  const BoxTable boxes = table_of(cloud(200, random));
  const GridChoice choice = choose_grid(sum_boxes(boxes), 1000);
  ASSERT_TRUE(choice.layout.has_value());
  UniformGrid grid(*choice.layout, boxes);
  EXPECT_TRUE(grid.validate(boxes).ok());
  const CellRange right = choice.layout->range_of(boxes[3]);
  BoxTable moved = boxes;
  moved.write(3) = cube(Vec3d(9.0, -9.0, 9.0), 0.1);
  const CellRange corner = choice.layout->range_of(moved[3]);
  const RangeChange there{3, right, corner};
  EXPECT_FALSE(grid.validate(moved).ok());
  grid.apply(std::span(&there, 1), moved);
  EXPECT_TRUE(grid.validate(moved).ok());
  EXPECT_FALSE(grid.validate(boxes).ok());
}

/// What rays visit, in order, each up to a far that every visit draws nearer.
using Way = std::vector<std::uint32_t>;

double narrowed(double far, std::uint32_t id) {
  return id % 7 == 3 ? 0.9 * far : far;
}

/// Narrows the rays' ranges when it is asked to finish.
struct RecordWays {
  std::vector<Way>& ways;
  std::size_t& together;    ///< visits of several rays at once
  std::uint32_t& visiting;  ///< rays of visits that are not finished

  void visit(std::uint32_t id, std::uint32_t rays, double* /*far*/) const {
    together += std::size_t((rays & (rays - 1)) != 0);
    EXPECT_EQ(visiting & rays, 0U) << "a ray went on before its visit was finished";
    visiting |= rays;
    for (std::size_t i = 0; i < ways.size(); ++i)
      if ((rays >> i & 1U) != 0) ways[i].push_back(id);
  }
  void finish(double* far) const {
    for (std::size_t i = 0; i < ways.size(); ++i)
      if ((visiting >> i & 1U) != 0) far[i] = narrowed(far[i], ways[i].back());
    visiting = 0;
  }
  void prefetch(std::uint32_t /*id*/) const {}
  [[nodiscard]] bool goes_on() const { return true; }
};

/// Rays for a group: most of them neighbours, some empty or from far away.
std::vector<Ray> group_of_rays(const Bounds3d& bounds, test::Random& random) {
  std::vector<Ray> rays;
  const Ray middle = random_ray(bounds, random);
  const std::size_t count = 1 + random.below(kGroupSize);
  while (rays.size() < count) {
    Ray ray = random.below(3) == 0 ? random_ray(bounds, random) : middle;
    ray.direction += 0.01 * max_abs(ray.direction) * random.in_box(1.0);
    ray.tfar = random.below(2) == 0 ? 2.0 : 1e9;
    if (random.below(12) == 0) ray.tnear = 3.0;
    if (random.below(12) == 0) ray.origin -= 1e12 * ray.direction;
    rays.push_back(ray);
  }
  return rays;
}

TEST(TopLevel, a_group_visits_what_its_rays_would_visit_alone) {
  test::Random random(test::seed_or(25));
  std::size_t together = 0;
  for (const auto& [name, boxes] : arrangements()) {
    SCOPED_TRACE(name);
    for (const auto choice : {TopLevelChoice::kAuto, TopLevelChoice::kNone}) {
      const TopLevel level = TopLevel::build(boxes, choice);
      for (int round = 0; round < (choice == TopLevelChoice::kAuto ? 60 : 4); ++round) {
        const std::vector<Ray> rays = group_of_rays(level.bounds(), random);
        std::vector<Way> alone(rays.size()), ways(rays.size());
        std::vector<const Ray*> group;
        std::vector<double> far;
        for (std::size_t i = 0; i < rays.size(); ++i) {
          double reach = rays[i].tfar;
          group.push_back(&rays[i]);
          far.push_back(reach);
          level.traverse(rays[i], reach, [&](std::uint32_t id) {
            alone[i].push_back(id);
            return reach = narrowed(reach, id);
          });
        }
        std::uint32_t visiting = 0;
        level.traverse_group(group, far.data(), RecordWays{ways, together, visiting});
        EXPECT_EQ(visiting, 0U);
        EXPECT_EQ(ways, alone);
      }
    }
    if (::testing::Test::HasFailure()) return;
  }
  EXPECT_GT(together, 1000U);
}

}  // namespace
}  // namespace gridcast::tlas
