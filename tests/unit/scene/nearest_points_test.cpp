// Nearest surface points against every triangle of every instance.

#include <cmath>

#include "core/mesh/nearest_point.h"
#include "core/scene/points.h"
#include "tests/unit/scene/list_fixture.h"

namespace gridcast::scene {
namespace {

NearestColumns nearest(const Scene& scene, const std::vector<double>& points,
                       const NearestOptions& options = {}) {
  auto found = nearest_points(scene, {std::as_bytes(std::span(points))}, options);
  EXPECT_TRUE(found.ok());
  return *std::move(found);
}

/// Rotated, mirrored, sheared, with a scale per axis from 1e-3 to 1e3 of its own.
Affine wild_affine(test::Random& random) {
  Affine affine = random_affine(random, 10.0, 1.0);
  const Mat3d turn(glm::rotate(glm::dmat4(1.0), random.uniform(0.0, 6.3), random.direction()));
  Mat3d scale(1.0);
  for (int axis = 0; axis < 3; ++axis) scale[axis][axis] = std::pow(10.0, random.uniform(-3.0, 3.0));
  affine.linear = turn * scale * affine.linear;
  return affine;
}

using Wide = glm::vec<3, long double>;

/// Distance of the origin to a triangle by the regions of its plane ("Real-Time Collision Detection",
/// C. Ericson, 2005, 5.1.5), in long double.
long double region_distance(const Wide& a, const Wide& b, const Wide& c) {
  const Wide ab = b - a, ac = c - a;
  const long double d1 = -glm::dot(ab, a), d2 = -glm::dot(ac, a);
  if (d1 <= 0 && d2 <= 0) return glm::length(a);
  const long double d3 = -glm::dot(ab, b), d4 = -glm::dot(ac, b);
  if (d3 >= 0 && d4 <= d3) return glm::length(b);
  const long double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return glm::length(a + d1 / (d1 - d3) * ab);
  const long double d5 = -glm::dot(ab, c), d6 = -glm::dot(ac, c);
  if (d6 >= 0 && d5 <= d6) return glm::length(c);
  const long double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return glm::length(a + d2 / (d2 - d6) * ac);
  const long double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return glm::length(b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b));
  return glm::length(a + (vb * ab + vc * ac) / (va + vb + vc));
}

struct Nearest {
  double distance = std::numeric_limits<double>::infinity();
  std::uint32_t instance_id = kInvalidId, primitive_id = kInvalidId;
  long double by_regions = std::numeric_limits<long double>::infinity();
  double size = 0.0;  ///< of the numbers that the distance was made of
};

/// The world triangle relative to the point, as rounded to double; no culling, no object space.
Nearest nearest_of_all(const Scene& scene, const Vec3d& point) {
  Nearest best;
  for (std::uint32_t id = 0; id < scene.instance_slots(); ++id) {
    const Instance instance = scene.instance(id);
    const Affine& world = instance.transform.world_from_object();
    const mesh::TriangleMesh& mesh = scene.blas(instance.mesh_id).mesh();
    for (std::uint32_t k = 0; k < mesh.triangle_count(); ++k) {
      Vec3d corner[3];
      for (int c = 0; c < 3; ++c)
        corner[c] = world.linear * Vec3d(mesh.corners(k)[std::size_t(c)]) + (world.translation - point);
      const double distance = mesh::nearest_to_origin(corner[0], corner[1], corner[2]).distance;
      best.by_regions =
          std::min(best.by_regions, region_distance(Wide(corner[0]), Wide(corner[1]), Wide(corner[2])));
      if (distance < best.distance) {
        best.distance = distance;
        best.instance_id = id;
        best.primitive_id = k;
        best.size = std::max({max_abs(corner[0]), max_abs(corner[1]), max_abs(corner[2])});
      }
    }
  }
  return best;
}

/// Near and far, some within a hair of a surface, some where several are equally near.
std::vector<double> points_around(const Scene& scene, test::Random& random, int count) {
  std::vector<double> rows;
  const double size = max_abs(scene.bounds().extent());
  for (int i = 0; i < count; ++i) {
    const Instance instance = scene.instance(random.below(std::uint32_t(scene.instance_slots())));
    Vec3d p = instance.transform.world_from_object().point(random.in_box(1.2));
    if (i % 3 == 1) p += std::pow(10.0, random.uniform(-4.0, 0.5)) * size * random.direction();
    if (i % 3 == 2) p = scene.bounds().lower + size * (random.in_box(0.6) + Vec3d(0.5));
    rows.insert(rows.end(), {p.x, p.y, p.z});
  }
  return rows;
}

/// Every structure gives the bits of the search without one, which are right but for rounding.
void check_against_all(const SceneData& data, test::Random& random, int count) {
  std::vector<double> points;
  std::vector<Nearest> expected;
  for (const blas::StructureKind kind : kKinds) {
    SceneBuildOptions options;
    options.blas.kind = kind;
    const auto scene = built(data, options);
    if (points.empty()) {
      points = points_around(*scene, random, count);
      for (std::size_t i = 0; i < points.size(); i += 3)
        expected.push_back(nearest_of_all(*scene, {points[i], points[i + 1], points[i + 2]}));
    }
    const NearestColumns found = nearest(*scene, points);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const Nearest& one = expected[i];
      ASSERT_EQ(found.status[i], RayStatus::kHit);
      ASSERT_EQ(found.distance[i], one.distance) << "structure " << int(kind) << ", point " << i;
      ASSERT_EQ(found.instance_id[i], one.instance_id) << "structure " << int(kind) << ", point " << i;
      ASSERT_EQ(found.primitive_id[i], one.primitive_id) << "structure " << int(kind) << ", point " << i;
      ASSERT_NEAR(found.distance[i], double(one.by_regions), 1e-7 * one.distance + 1e-9 * one.size) << i;
      const Vec3d to{found.position[3 * i] - points[3 * i], found.position[3 * i + 1] - points[3 * i + 1],
                     found.position[3 * i + 2] - points[3 * i + 2]};
      ASSERT_NEAR(glm::length(to), one.distance,
                  1e-12 * (one.size + max_abs(scene->bounds().upper) + max_abs(scene->bounds().lower)));
    }
  }
}

TEST(NearestPoints, wild_instances_are_measured_in_the_world) {
  test::Random random(test::seed_or(71));
  for (int scene = 0; scene < 12; ++scene) {
    SceneData data = meshes_only();
    const int instances = scene < 8 ? 1 : 5;
    for (int i = 0; i < instances; ++i) place(data, random.below(4), wild_affine(random));
    check_against_all(data, random, 60);
  }
}

TEST(NearestPoints, no_cell_of_the_grid_is_left_out) {
  test::Random random(test::seed_or(72));
  for (auto& [name, data] : awkward_scenes(40, random)) {
    SCOPED_TRACE(name);
    check_against_all(data, random, 25);
  }
}

TEST(NearestPoints, of_many_instances_the_nearest_is_found) {
  test::Random random(test::seed_or(73));
  SceneData data;
  data.meshes = {test::share(test::box({-1, -1, -1}, {1, 1, 1})), test::share(test::single_triangle())};
  for (int i = 0; i < 3000; ++i)
    place(data, random.below(2), random_affine(random, 40.0, std::pow(10.0, random.uniform(-2.0, 0.3))));
  check_against_all(data, random, 60);
}

TEST(NearestPoints, ties_go_to_the_smallest_ids) {
  for (const blas::StructureKind kind : kKinds) {
    SceneData data;
    data.meshes = {test::share(test::repeated(test::box({-1, -1, -1}, {1, 1, 1}), 40))};
    for (int i = 0; i < 5; ++i) place(data, 0, {});
    place(data, 0, {Mat3d(1.0), Vec3d(6.0, 0.0, 0.0)});
    SceneBuildOptions options;
    options.blas.kind = kind;
    const auto scene = built(data, options);
    // The middle between two boxes, a corner's own direction, and a point on an edge of many triangles.
    const NearestColumns found = nearest(*scene, {3, 0, 0, -2, -2, -2, 1, 1, 0});
    EXPECT_EQ(found.instance_id, (std::vector<std::uint32_t>{0, 0, 0})) << int(kind);
    for (const std::uint32_t id : found.primitive_id) EXPECT_LT(id, 12U) << int(kind);
    EXPECT_EQ(found.distance[0], 2.0);
    EXPECT_EQ(found.distance[2], 0.0);
  }
}

TEST(NearestPoints, the_largest_distance_is_within) {
  for (const blas::StructureKind kind : kKinds) {
    SceneData data;
    data.meshes = {test::share(test::box({-1, -1, -1}, {1, 1, 1}))};
    place(data, 0, {Mat3d(2.0), Vec3d(100.0, 0.0, 0.0)});
    SceneBuildOptions options;
    options.blas.kind = kind;
    const auto scene = built(data, options);
    const std::vector<double> point{95, 0, 0};
    NearestOptions within;
    within.max_distance = 3.0;
    EXPECT_EQ(nearest(*scene, point, within).status[0], RayStatus::kHit) << int(kind);
    within.max_distance = std::nextafter(3.0, 0.0);
    const NearestColumns none = nearest(*scene, point, within);
    EXPECT_EQ(none.status[0], RayStatus::kMiss) << int(kind);
    EXPECT_EQ(none.instance_id[0], kInvalidId);
    EXPECT_EQ(none.distance[0], std::numeric_limits<double>::infinity());
    within.max_distance = 0.0;
    EXPECT_EQ(nearest(*scene, {98, 1, 1}, within).status[0], RayStatus::kHit) << "on the surface";
  }
}

TEST(NearestPoints, a_cancelled_search_says_so) {
  SceneData data = meshes_only();
  place(data, 0, {});
  std::stop_source stop;
  stop.request_stop();
  NearestOptions options;
  options.stop = stop.get_token();
  const std::vector<double> point{0, 0, 0};
  const auto found = nearest_points(*built(data), {std::as_bytes(std::span(point))}, options);
  ASSERT_FALSE(found.ok());
  EXPECT_EQ(found.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::scene
