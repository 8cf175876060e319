// The grid over instances: no cell is skipped, no instance is tested twice, and crowds stay in their bounds.

#include <algorithm>
#include <map>
#include <thread>

#include <gtest/gtest.h>

#include "core/tlas/grid_cost.h"
#include "core/tlas/grid_walk.h"
#include "tests/stability/crossed_cells.h"
#include "tests/stability/subject.h"
#include "tests/stability/truth.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::stability {
namespace {

using tlas::Cell;
using tlas::GridLayout;

/// -1, 0 (of either sign) or 1 on each axis, or lengths of these signs; never all 0.
Vec3d patterned_direction(test::Random& random) {
  const std::uint32_t pattern = random.below(26);
  const std::uint32_t kinds = pattern < 13 ? pattern : pattern + 1;  // 13 is all 0
  const bool lattice = random.below(2) == 0;
  Vec3d direction;
  const std::uint32_t of_axis[3] = {kinds % 3, kinds / 3 % 3, kinds / 9};
  for (int axis = 0; axis < 3; ++axis) {
    const double length = lattice ? 1.0 : random.uniform(0.01, 1.0);
    direction[axis] = (double(of_axis[axis]) - 1.0) * length;
    if (of_axis[axis] == 1 && random.below(2) == 0) direction[axis] = -0.0;
  }
  return direction;
}

/// On a plane of the grid (the last one too), inside of a cell, or beside the grid.
Vec3d origin_at_cells(const Bounds3d& bounds, const std::uint32_t (&cells)[3], test::Random& random) {
  Vec3d origin;
  for (int axis = 0; axis < 3; ++axis) {
    const double n = cells[axis];
    const double places[] = {double(random.below(cells[axis] + 1)), random.uniform(0.0, n), -1.0, n + 2.0};
    const double place = places[random.below(8) % 5 % 4];
    origin[axis] = bounds.lower[axis] + place * (bounds.extent()[axis] / n);
  }
  return origin;
}

GridLayout layout_of(std::uint32_t cells, const Vec3d& lower, const Vec3d& size) {
  GridLayout layout;
  layout.bounds = {lower, lower + size};
  for (int axis = 0; axis < 3; ++axis) {
    layout.cells[axis] = cells;
    layout.cell[axis] = size[axis] / cells;
    layout.inverse_cell[axis] = cells / size[axis];
  }
  layout.reach = 1e6 * max_abs(size);
  layout.prepare();
  return layout;
}

/// What a walk visits, leaving some blocks at once as it does where nothing is listed.
struct Visits {
  std::vector<Cell> cells;
  std::vector<std::uint32_t> left_blocks;
};
Visits walk(Row& row, const GridLayout& layout, const Ray& ray, test::Random& random) {
  Visits visits;
  const bool leaves = random.below(2) == 0;
  tlas::GridWalk walk(layout, tlas::WorldRay(ray), ray.tfar);
  const std::size_t most = std::size_t(layout.cells[0]) + layout.cells[1] + layout.cells[2] - 2;
  while (!walk.done()) {
    const Cell cell = walk.cell();
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (cell[axis] >= layout.cells[axis]) row.fail("a walk's cell is out of range");
    visits.cells.push_back(cell);
    if (visits.cells.size() > most) {
      row.fail("a walk does not end");
      break;
    }
    if (leaves && random.below(3) == 0) {
      visits.left_blocks.push_back(walk.block());
      walk.leave_block();
    } else {
      walk.step();
    }
  }
  std::sort(visits.cells.begin(), visits.cells.end());
  return visits;
}

// For every grid the exact list of cells: each with a chord longer than 1e-12 of the grid (beyond the
// rounding that boxes are filed with) must be visited.
TEST(Stability, RC26_NoCellIsSkipped) {
  Row row(26, 16000);
  std::size_t cells = 0;
  for (const std::uint32_t n : {1U, 2U, 3U, 16U, 64U, 256U, 1024U}) {
    for (const double offset : {0.0, 1e3, 1e6}) {
      const std::size_t share = row.rays(n > 64 ? 84 : 21);
      for (const Vec3d& size : {Vec3d(1.0), Vec3d(7.3, 0.4, 2.1)}) {
        const GridLayout layout = layout_of(n, Vec3d(offset, -offset, 0.3 * offset), size);
        row.blocks(share / 2 + 1, [&](test::Random& random, std::size_t count) {
          for (std::size_t i = 0; i < count; ++i) {
            Ray ray{origin_at_cells(layout.bounds, layout.cells, random), patterned_direction(random), 0.0,
                    1e9};
            if (random.below(3) == 0) ray.tnear = -1e9;
            if (random.below(5) == 0) ray.tfar = random.uniform(0.0, 2.0);
            const double slack =
                tlas::rounding_slack(tlas::WorldRay(ray).distance_to(layout.bounds), layout.bounds);
            const Visits visits = walk(row, layout, ray, random);
            const double least = 1e-12 * max_abs(size) / max_abs(ray.direction);
            for (const Cell& cell : crossed_cells(layout, ray)) {
              if (!has_chord(layout, cell, ray, slack, least)) continue;
              ++cells;
              const bool left = std::count(visits.left_blocks.begin(), visits.left_blocks.end(),
                                           layout.block_of(cell[0], cell[1], cell[2])) != 0;
              if (!left && !std::binary_search(visits.cells.begin(), visits.cells.end(), cell))
                row.fail("a cell is skipped in a grid of " + std::to_string(n) + "^3 at offset " +
                         std::to_string(offset));
            }
          }
          row.count(count, count);
        });
      }
    }
  }
  EXPECT_GT(cells, row.rays());
  std::cout << cells << " cells with a chord\n";
}

/// n^3 boxes with sides of one, two apart.
SceneSpec box_lattice(int n) {
  SceneSpec spec;
  spec.meshes = {generated("box 0 0 0 1 1 1")};
  for (int i = 0; i < n * n * n; ++i)
    spec.instances.push_back({0, {Mat3d(1.0), 2.0 * Vec3d(i % n, i / n % n, double(i / (n * n)))}});
  return spec;
}

TEST(Stability, RC04_OriginsOnTheGrid) {
  Row row(4, 6000);
  for (const int n : {2, 6}) {
    Subject subject(box_lattice(n));
    const WorldTruth truth(subject.spec());
    const tlas::TopLevelStats stats = subject.scene().top_level().stats();
    ASSERT_NE(stats.kind, tlas::TopLevelKind::kNone) << stats.reason;
    // Planes of the cells, and planes of the instances' own boxes.
    const Bounds3d lattice{Vec3d(0.0), Vec3d(2.0 * n - 1.0)};
    const std::uint32_t sides[3] = {2U * std::uint32_t(n) - 1, 2U * std::uint32_t(n) - 1,
                                    2U * std::uint32_t(n) - 1};
    row.blocks(row.rays(2), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        const bool cells = random.below(2) == 0;
        const Vec3d origin = cells ? origin_at_cells(stats.bounds, stats.cells, random)
                                   : origin_at_cells(lattice, sides, random);
        // Towards a corner of the grid from outside, now and then.
        Vec3d direction = patterned_direction(random);
        if (random.below(6) == 0) {
          for (int axis = 0; axis < 3; ++axis)
            direction[axis] =
                (random.below(2) == 0 ? stats.bounds.lower[axis] : stats.bounds.upper[axis]) - origin[axis];
          if (max_abs(direction) == 0.0) continue;
        }
        const Ray ray{origin, direction};
        shots.push_back(truth.shot(subject.scene(), ray));
      }
      subject.shoot(row, shots);
    });
  }
}

/// Calls visit as a query that nothing stops does, and reports an instance that comes twice.
std::size_t visit_all(Row& row, const scene::Scene& scene, const Ray& ray) {
  std::vector<std::uint32_t> ids;
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    ids.push_back(id);
    return ray.tfar;
  });
  std::sort(ids.begin(), ids.end());
  if (std::adjacent_find(ids.begin(), ids.end()) != ids.end())
    row.fail("an instance is tested twice by a ray");
  return ids.size();
}

/// Small boxes, and a slanted sheet that more than a thousand of their cells list.
SceneSpec sheet_through_boxes() {
  constexpr int kBoxes = 16;
  SceneSpec spec = box_lattice(kBoxes);
  for (Placement& placement : spec.instances) placement.world_from_object.linear = Mat3d(0.25);
  spec.meshes.push_back(generated("quad_grid 2 1"));
  spec.instances.push_back(
      {1, {Mat3d(30.0, 2.0, 25.0, -3.0, 30.0, 4.0, 0.0, 0.0, 1.0), Vec3d(1.0, 1.5, 1.0)}});
  return spec;
}

// A hit on a sheet that lies in a later cell must not end the walk, and no instance is tested twice however
// many cells list it.
TEST(Stability, RC27_InstancesInManyCells) {
  Row row(27, 3000);
  Subject subject(sheet_through_boxes());
  const WorldTruth truth(subject.spec());
  const tlas::TopLevelStats stats = subject.scene().top_level().stats();
  EXPECT_GT(stats.reference_count, stats.instance_count + 1000) << stats.reason;
  std::size_t visits = 0;
  row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
    std::vector<Shot> shots;
    for (std::size_t i = 0; i < count; ++i) {
      const Ray ray = scene::random_ray(subject.scene(), random);
      shots.push_back(truth.shot(subject.scene(), ray));
      visits += visit_all(row, subject.scene(), ray);
    }
    subject.shoot(row, shots);
  });
  EXPECT_GT(visits, row.rays());
}

// Nothing is stored from ray to ray (a bit beside each listed box says whether the cell before lists it too),
// so no number of rays can wrap and threads share nothing: many rays of one scene on several threads at once,
// in different orders, visit what they visit alone.
TEST(Stability, RC28_NoStateBetweenRays) {
  Row row(28, 4000);
  constexpr std::size_t kThreads = 4;
  const auto scene = scene::build_scene(scene_data(sheet_through_boxes())).value();
  row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
    std::vector<Ray> rays;
    std::vector<SurfaceHit> alone;
    for (std::size_t i = 0; i < count; ++i) {
      rays.push_back(scene::random_ray(*scene, random));
      alone.push_back(scene::intersect(*scene, rays.back()));
    }
    std::array<std::size_t, kThreads> different{};
    {
      std::vector<std::jthread> threads;
      for (std::size_t k = 0; k < kThreads; ++k)
        threads.emplace_back([&, k] {
          for (std::size_t i = 0; i < count; ++i) {
            const std::size_t ray = k % 2 == 0 ? i : count - 1 - i;
            if (!same_bits(scene::intersect(*scene, rays[ray]), alone[ray])) ++different[k];
          }
        });
    }
    for (const std::size_t k : different)
      if (k != 0) row.fail("answers differ among threads for " + std::to_string(k) + " rays");
    row.count(count, kThreads * count);
  });
}

/// The grid's bounds of memory hold.
void expect_bounded(const scene::Scene& scene, const std::string& name) {
  const tlas::TopLevelStats stats = scene.top_level().stats();
  const std::uint64_t boxes = scene.instance_slots() * sizeof(tlas::InstanceBox);
  EXPECT_LE(stats.cell_count, tlas::max_cells(stats.instance_count)) << name << ": " << stats.reason;
  EXPECT_LE(stats.memory_bytes, tlas::max_bytes(stats.instance_count) + 2 * boxes)
      << name << ": " << stats.reason;
  const Status valid = scene.validate();
  EXPECT_TRUE(valid.ok()) << name << ": " << valid.error().message;
}

std::map<std::string, SceneSpec> awkward_grids() {
  std::map<std::string, SceneSpec> all;
  const std::vector<MeshSource> meshes = {generated("jittered_icosphere 1 29"), generated("quad_grid 2 1")};
  for (const char* name : {"one instance", "flat city", "stadium", "line", "two far apart"})
    all[name].meshes = meshes;
  test::Random random(29);
  all["one instance"].instances = {{0, {Mat3d(2.0), Vec3d(5.0)}}};
  // All in z = 0: an axis without extent.
  for (int i = 0; i < 1600; ++i)
    all["flat city"].instances.push_back({1, {Mat3d(1.0), Vec3d(i % 40 * 1.5, i / 40 * 1.5, 0.0)}});
  // Everything in one place of a scene a million times as large.
  for (int i = 0; i < 500; ++i) all["stadium"].instances.push_back({0, {Mat3d(0.1), random.in_box(1.0)}});
  all["stadium"].instances.push_back({0, {Mat3d(1.0), Vec3d(1e6, 1e6, 1e6)}});
  for (int i = 0; i < 1000; ++i) all["line"].instances.push_back({0, {Mat3d(0.3), Vec3d(i, 0.0, 0.0)}});
  all["two far apart"].instances = {{0, {Mat3d(1.0), Vec3d(0.0)}}, {1, {Mat3d(1.0), Vec3d(1e9, -1e9, 1e3)}}};
  return all;
}

TEST(Stability, RC29_DegenerateGrids) {
  Row row(29, 5000);
  const auto scenes = awkward_grids();
  for (const auto& [name, spec] : scenes) {
    Subject subject(spec);
    const WorldTruth truth(spec);
    expect_bounded(subject.scene(), name);
    const Bounds3d bounds = subject.scene().bounds();
    row.blocks(row.rays(scenes.size()), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        Ray ray = scene::random_ray(subject.scene(), random);
        // From one end of the emptiness to the other, and in the plane of a flat scene.
        if (i % 4 == 0) ray = {bounds.lower, bounds.extent() * random.uniform(0.5, 2.0)};
        if (i % 4 == 1) ray.direction.z = 0.0;
        if (i % 8 == 1) ray.origin.z = 0.0;
        if (!is_valid(ray)) continue;
        shots.push_back(truth.shot(subject.scene(), ray));
        (void)visit_all(row, subject.scene(), ray);
      }
      subject.shoot(row, shots);
    });
  }
}

// Ten thousand boxes in the same place, and ten thousand in one another: the closest is known without
// looking.
TEST(Stability, RC30_ThousandsOfOverlappingInstances) {
  Row row(30, 120);
  constexpr int kInstances = 10000;
  const MeshSource box = generated("box -1 -1 -1 1 1 1");
  for (const bool nested : {false, true}) {
    SceneSpec spec;
    spec.meshes = {box};
    // Sizes of whole sixteenths, so that box_truth is exact.
    for (int i = 0; i < kInstances; ++i) {
      const double size = nested ? 0.0625 * (kInstances - i) : 1.0;
      spec.instances.push_back({0, {Mat3d(size), Vec3d(0.0)}});
    }
    Subject subject(std::move(spec));
    expect_bounded(subject.scene(), nested ? "nested" : "coincident");
    row.blocks(row.rays(2), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        // Within the shells or outside of them, along an axis or a diagonal of the lattice.
        const double reach = nested ? 0.0625 * random.below(12000) : random.below(4);
        Ray ray{reach * random.in_box(1.0), patterned_direction(random)};
        ray.origin = glm::round(ray.origin * 16.0) * 0x1p-4;
        // Shells are 1/16 apart and their scale's inverse is rounded: keep away from their planes and edges.
        if (nested) ray.origin += Vec3d(0x1p-5, 0x1p-6, 0x1p-7);
        ray.direction = glm::sign(ray.direction);
        double t = std::numeric_limits<double>::infinity();
        for (const Placement& placement : subject.spec().instances) {
          const double size = placement.world_from_object.linear[0][0];
          const Expectation hit = box_truth({Vec3d(-size), Vec3d(size)}, ray);
          if (hit.kind == Expectation::Kind::kHit) t = std::min(t, hit.t);
          if (!nested) break;
        }
        const bool hit = t < std::numeric_limits<double>::infinity();
        shots.push_back({ray, {}, hit ? Expectation::hit({}, t, nested ? 1e-10 : 0.0) : Expectation::miss()});
      }
      // Exact mode would decide ten thousand ties in integers.
      Answers answers = subject.ask(row, shots, std::span(kPrecisions).first(2));
      for (std::size_t i = 0; i < shots.size() && !nested; ++i)
        if (answers.robust[i].status == RayStatus::kHit && answers.robust[i].instance_id != 0)
          row.fail(subject.spec(), shots[i], "of coincident instances " + describe(answers.robust[i]));
    });
  }
}

}  // namespace
}  // namespace gridcast::stability
