// All hits of a ray: in order, each once, in pages that lose and repeat nothing; crossings that add up.

#include "core/scene/all_hits.h"

#include <algorithm>

#include "core/scene/points.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

constexpr blas::StructureKind kKinds[] = {blas::StructureKind::kBruteForce, blas::StructureKind::kBvh,
                                          blas::StructureKind::kWideBvh, blas::StructureKind::kKdTree,
                                          blas::StructureKind::kEmbree};

std::vector<double> rows_of(const std::vector<Ray>& rays) {
  std::vector<double> rows;
  for (const Ray& r : rays)
    for (const double x :
         {r.origin.x, r.origin.y, r.origin.z, r.tnear, r.direction.x, r.direction.y, r.direction.z, r.tfar})
      rows.push_back(x);
  return rows;
}

RayBatch batch_of(const std::vector<double>& rows) {
  return {std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, {}};
}

HitLists all_hits(const Scene& scene, const std::vector<double>& rows, const AllHitsOptions& options = {}) {
  auto lists = intersect_all(scene, batch_of(rows), options);
  EXPECT_TRUE(lists.ok());
  return *std::move(lists);
}

bool same_lists(const HitLists& a, const HitLists& b) {
  return a.status == b.status && a.splits == b.splits && a.hits.t == b.hits.t && a.hits.uv == b.hits.uv &&
         a.hits.instance_id == b.hits.instance_id && a.hits.primitive_id == b.hits.primitive_id;
}

TEST(AllHits, lists_are_the_same_for_every_structure_and_begin_with_the_closest_hit) {
  test::Random random(test::seed_or(51));
  SceneData data = meshes_only();
  for (int i = 0; i < 40; ++i) place(data, random.below(4), random_affine(random, 3.0, 0.5));
  HitLists first;
  std::vector<Ray> rays;
  std::vector<double> rows;
  for (const blas::StructureKind kind : kKinds) {
    SceneBuildOptions options;
    options.blas.kind = kind;
    const auto scene = built(data, options);
    if (rays.empty()) {
      for (int i = 0; i < 600; ++i) rays.push_back(random_ray(*scene, random));
      rows = rows_of(rays);
      first = all_hits(*scene, rows);
    }
    ASSERT_TRUE(same_lists(first, all_hits(*scene, rows))) << int(kind);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const SurfaceHit closest = intersect(*scene, rays[i]);
      ASSERT_EQ(first.status[i], closest.status);
      if (closest.status != RayStatus::kHit) continue;
      ASSERT_EQ(first.hits.t[first.splits[i]], closest.t);
      ASSERT_EQ(first.hits.primitive_id[first.splits[i]], closest.primitive_id);
    }
  }
  EXPECT_GT(first.splits.back(), 1000U);
}

TEST(AllHits, a_thousand_coincident_layers_page_without_loss_or_repetition) {
  for (const blas::StructureKind kind : kKinds) {
    SceneData data;
    data.meshes = {test::share(test::repeated(test::quad_grid(2), 500))};
    place(data, 0, {});
    place(data, 0, {});
    SceneBuildOptions build;
    build.blas.kind = kind;
    const auto scene = built(data, build);
    const std::vector<double> rows = rows_of({{{0.3, 0.1, 1.0}, {0.0, 0.0, -1.0}}});
    const HitLists whole = all_hits(*scene, rows);
    ASSERT_EQ(whole.splits[1], 1000U);
    for (const std::uint32_t page : {1U, 7U, 999U, 1000U}) {
      std::vector<HitPosition> after(1);
      std::size_t seen = 0;
      for (RayStatus status = RayStatus::kTruncated; status == RayStatus::kTruncated;) {
        AllHitsOptions options;
        options.max_hits = page;
        options.after = after;
        const HitLists part = all_hits(*scene, rows, options);
        status = part.status[0];
        for (std::size_t k = 0; k < part.splits[1]; ++k, ++seen) {
          ASSERT_LT(seen, 1000U);
          ASSERT_EQ(part.hits.instance_id[k], whole.hits.instance_id[seen]);
          ASSERT_EQ(part.hits.primitive_id[k], whole.hits.primitive_id[seen]);
        }
        if (part.splits[1] == 0) break;
        after[0] = {part.hits.t.back(), part.hits.instance_id.back(), part.hits.primitive_id.back()};
      }
      ASSERT_EQ(seen, 1000U) << "pages of " << page;
    }
  }
}

TEST(AllHits, more_than_the_total_is_an_error) {
  SceneData data = meshes_only();
  place(data, 0, {});
  const auto scene = built(data);
  const std::vector<double> rows = rows_of({{{0.0, 0.0, 5.0}, {0.01, 0.02, -1.0}}});
  AllHitsOptions options;
  options.max_total_hits = 1;
  const auto lists = intersect_all(*scene, batch_of(rows), options);
  ASSERT_FALSE(lists.ok());
  EXPECT_EQ(lists.error().code, ErrorCode::kLimitExceeded);
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
