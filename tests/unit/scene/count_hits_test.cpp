// Counts of hits that add up: crossings, winding numbers, and what points are inside of.

#include <algorithm>
#include <cmath>
#include <set>

#include <oneapi/tbb/global_control.h>

#include "core/mesh/crossing.h"
#include "core/scene/all_hits.h"
#include "core/scene/points.h"
#include "tests/support/closed_mesh.h"
#include "tests/support/moved_crossing.h"
#include "tests/support/rational_oracle.h"
#include "tests/unit/scene/list_fixture.h"

namespace gridcast::scene {
namespace {

/// Around solid unit cells on a lattice, so that rays between lattice points meet edges and vertices, and
/// start on them.
struct Lattice {
  test::TriangleMesh mesh = test::voxel_boundary(4, 3);
  std::vector<Ray> rays;

  explicit Lattice(test::Random& random, int count) {
    const auto point = [&] {
      return 0.5 * Vec3d(random.below(11), random.below(11), random.below(11)) - 0.5;
    };
    for (int i = 0; i < count; ++i) {
      const Vec3d origin = point();
      Vec3d direction = point() - origin;
      if (i % 5 == 0) direction[int(random.below(3))] = 0.0;
      if (direction == Vec3d(0.0)) direction.x = 1.0;
      rays.push_back({origin, direction});
    }
  }
};

TEST(CountHits, crossings_are_those_of_fractions_with_a_moved_origin) {
  test::Random random(test::seed_or(57));
  const Lattice lattice(random, 400);
  std::vector<std::uint32_t> crossings;
  std::vector<std::int32_t> winding;
  std::size_t on_surface = 0;
  for (const Ray& ray : lattice.rays) {
    std::uint32_t count = 0;
    std::int32_t sum = 0;
    bool starts_on = false;
    for (std::uint32_t k = 0; k < lattice.mesh.triangle_count(); ++k) {
      const auto [p0, p1, p2] = lattice.mesh.corners(k);
      const auto one = test::moved_crossing(ray.origin, ray.direction, Vec3d(p0), Vec3d(p1), Vec3d(p2));
      starts_on = starts_on || mesh::lies_on(ray.origin, Vec3d(p0), Vec3d(p1), Vec3d(p2));
      if (one.crossing == 0 || !one.ahead) continue;
      ++count;
      sum += one.crossing;
    }
    // A second opinion: the solid angles around an origin that is really moved.
    const double angles = test::winding_number(lattice.mesh, ray.origin + Vec3d(0x1p-4, 0x1p-8, 0x1p-12));
    ASSERT_EQ(sum, std::int32_t(std::lround(angles)));
    crossings.push_back(count);
    winding.push_back(sum);
    on_surface += std::size_t(starts_on);
  }
  EXPECT_GT(on_surface, 50U);
  for (const blas::StructureKind kind : kKinds) {
    SceneData data;
    data.meshes = {test::share(lattice.mesh)};
    place(data, 0, {});
    SceneBuildOptions build;
    build.blas.kind = kind;
    const auto counts = count_hits(*built(data, build), batch_of(rows_of(lattice.rays)), {});
    ASSERT_TRUE(counts.ok());
    EXPECT_EQ(counts->winding, winding) << int(kind);
    EXPECT_EQ(counts->crossings, crossings) << int(kind);
  }
}

TEST(CountHits, counts_and_lists_are_those_of_fractions) {
  test::Random random(test::seed_or(58));
  const Lattice lattice(random, 400);
  const test::RationalOracle oracle({{lattice.mesh.positions, lattice.mesh.triangles}}, {{0, 0, {}}});
  SceneData data;
  data.meshes = {test::share(lattice.mesh)};
  place(data, 0, {});
  const auto scene = built(data);
  const std::vector<double> rows = rows_of(lattice.rays);
  const auto counts = count_hits(*scene, batch_of(rows), {});
  const auto lists = intersect_all(*scene, batch_of(rows), {});
  ASSERT_TRUE(counts.ok() && lists.ok());
  for (std::size_t i = 0; i < lattice.rays.size(); ++i) {
    std::set<std::uint32_t> expected, listed;
    for (const test::RationalHit& hit : oracle.all(lattice.rays[i]))
      expected.insert(hit.primitive.primitive_id);
    for (std::uint64_t row = lists->splits[i]; row < lists->splits[i + 1]; ++row)
      listed.insert(lists->hits.primitive_id[row]);
    ASSERT_EQ(listed, expected) << i;
    ASSERT_EQ(counts->count[i], expected.size()) << i;
  }
}

TEST(CountHits, counts_of_instances_add_up_in_any_order_of_rays_and_threads) {
  test::Random random(test::seed_or(59));
  SceneData data = meshes_only();
  for (int i = 0; i < 40; ++i) place(data, random.below(3), random_affine(random, 3.0, 0.5));
  const auto scene = built(data);
  std::vector<Ray> rays;
  for (int i = 0; i < 1500; ++i) {
    Ray ray = random_ray(*scene, random);
    ray.tnear = 0.0;
    ray.tfar = std::numeric_limits<double>::infinity();
    rays.push_back(ray);
  }
  const auto counts = count_hits(*scene, batch_of(rows_of(rays)), {});
  const auto lists = intersect_all(*scene, batch_of(rows_of(rays)), {});
  ASSERT_TRUE(counts.ok() && lists.ok());
  for (std::size_t i = 0; i < rays.size(); ++i)
    ASSERT_EQ(counts->count[i], lists->splits[i + 1] - lists->splits[i]) << i;
  std::vector<Ray> turned(rays.rbegin(), rays.rend());
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  auto others = count_hits(*scene, batch_of(rows_of(turned)), {});
  ASSERT_TRUE(others.ok());
  std::reverse(others->winding.begin(), others->winding.end());
  std::reverse(others->crossings.begin(), others->crossings.end());
  EXPECT_EQ(others->winding, counts->winding);
  EXPECT_EQ(others->crossings, counts->crossings);

  // The same question in points: inside of as many instances as the windings of a ray say.
  std::vector<double> points;
  for (const Ray& ray : rays) points.insert(points.end(), {ray.origin.x, ray.origin.y, ray.origin.z});
  const auto inside = points_inside(*scene, {std::as_bytes(std::span(points))}, {});
  ASSERT_TRUE(inside.ok());
  std::size_t within = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    std::int32_t sum = 0;
    for (std::uint64_t row = inside->splits[i]; row < inside->splits[i + 1]; ++row)
      sum += inside->winding[row];
    ASSERT_EQ(sum, counts->winding[i]) << i;
    within += std::size_t(sum > 0);
  }
  EXPECT_GT(within, 30U);
}

TEST(CountHits, rays_at_vertices_and_edges_from_inside_wind_once_on_every_structure) {
  test::Random random(test::seed_or(52));
  const auto mesh = test::share(test::jittered_icosphere(3, 5));
  std::vector<Ray> rays;
  std::vector<std::int32_t> expected;
  for (int i = 0; i < 2000; ++i) {
    const auto corners = mesh->corners(random.below(std::uint32_t(mesh->triangle_count())));
    // The middle of the edge of two floats near each other is a double.
    const Vec3d target = 0.5 * (Vec3d(corners[0]) + Vec3d(corners[i % 2 == 0 ? 0 : 1]));
    const bool inside = i % 4 < 2;
    const Vec3d origin = inside ? Vec3d(0.0) : 4.0 * random.direction();
    rays.push_back({origin, target - origin});
    expected.push_back(inside ? 1 : 0);
  }
  const std::vector<double> rows = rows_of(rays);
  for (const blas::StructureKind kind : kKinds) {
    SceneData data;
    data.meshes = {mesh};
    place(data, 0, {});
    SceneBuildOptions build;
    build.blas.kind = kind;
    const auto counts = count_hits(*built(data, build), batch_of(rows), {});
    ASSERT_TRUE(counts.ok());
    ASSERT_EQ(counts->winding, expected) << int(kind);
    std::size_t shared = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(counts->crossings[i] % 2, std::uint32_t(expected[i])) << i;
      shared += std::size_t(counts->count[i] > counts->crossings[i]);
    }
    EXPECT_GT(shared, 200U) << "too few rays met several triangles at once to mean anything";
  }
}

TEST(PointsInside, places_and_nearest_points_of_a_box) {
  SceneData data;
  data.meshes = {test::share(test::box({-1, -1, -1}, {1, 1, 1})), test::share(test::quad_grid(2))};
  place(data, 0, {});
  place(data, 1, {Mat3d(4.0), Vec3d(10.0, 0.0, 0.0)});
  const std::vector<double> rows{0, 0, 0, 1, 0.25, 0, 3, 0, 0, 10, 0, 0, 1, 1, 1, NAN, 0, 0};
  for (const blas::StructureKind kind : kKinds) {
    SceneBuildOptions build;
    build.blas.kind = kind;
    const auto scene = built(data, build);
    const PointBatch points{std::as_bytes(std::span(rows))};
    const auto inside = points_inside(*scene, points, {});
    ASSERT_TRUE(inside.ok());
    using enum PointPlace;
    EXPECT_EQ(inside->place,
              (std::vector{kInside, kOnBoundary, kOutside, kOnBoundary, kOnBoundary, kInvalid}));
    EXPECT_EQ(inside->winding[0], 1);
    const auto nearest = nearest_points(*scene, points, {});
    ASSERT_TRUE(nearest.ok());
    EXPECT_EQ(nearest->distance[0], 1.0);
    EXPECT_EQ(nearest->distance[1], 0.0);
    EXPECT_EQ(nearest->distance[2], 2.0);
    EXPECT_EQ(nearest->position[6], 1.0);
    EXPECT_EQ(nearest->status[5], RayStatus::kInvalid);
  }
}

}  // namespace
}  // namespace gridcast::scene
