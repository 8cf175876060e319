// All hits of a ray: in order, each once, in pages that lose and repeat nothing.

#include "core/scene/all_hits.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <oneapi/tbb/global_control.h>

#include "tests/unit/scene/list_fixture.h"

namespace gridcast::scene {
namespace {

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

std::shared_ptr<const Scene> cloud_of(test::Random& random) {
  SceneData data = meshes_only();
  for (int i = 0; i < 40; ++i) place(data, random.below(4), random_affine(random, 3.0, 0.5));
  return built(data);
}

std::vector<Ray> rays_into(const Scene& scene, test::Random& random, int count) {
  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) rays.push_back(random_ray(scene, random));
  return rays;
}

TEST(AllHits, lists_are_every_triangle_tested_alone) {
  test::Random random(test::seed_or(53));
  const auto scene = cloud_of(random);
  const std::vector<Ray> rays = rays_into(*scene, random, 150);
  const HitLists lists = all_hits(*scene, rows_of(rays));
  EXPECT_GT(lists.splits.back(), 100U);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    std::vector<Hit> expected;
    mesh::ObjectRay object;
    for (std::uint32_t id = 0; id < scene->instance_slots(); ++id) {
      const Instance instance = scene->instance(id);
      const auto& mesh = scene->blas(instance.mesh_id).mesh();
      const Ray local{instance.transform.point_to_object(rays[i].origin),
                      instance.transform.vector_to_object(rays[i].direction), rays[i].tnear, rays[i].tfar};
      if (!object.prepare(local, mesh.bounds())) continue;
      object.instance_id = id;
      for (std::uint32_t k = 0; k < mesh.triangle_count(); ++k) {
        Hit one{.t = rays[i].tfar};
        const auto [p0, p1, p2] = mesh.corners(k);
        mesh::intersect_primitive<Precision::kRobust>(object, p0, p1, p2, k, one);
        if (one.primitive_id != kInvalidId) expected.push_back(one);
      }
    }
    std::sort(expected.begin(), expected.end(), closer);
    ASSERT_EQ(lists.splits[i + 1] - lists.splits[i], expected.size()) << i;
    for (std::size_t k = 0; k < expected.size(); ++k) {
      const std::size_t row = lists.splits[i] + k;
      ASSERT_EQ(lists.hits.t[row], expected[k].t);
      ASSERT_EQ(lists.hits.instance_id[row], expected[k].instance_id);
      ASSERT_EQ(lists.hits.primitive_id[row], expected[k].primitive_id);
    }
  }
}

TEST(AllHits, lists_depend_neither_on_the_order_of_rays_nor_on_threads) {
  test::Random random(test::seed_or(54));
  const auto scene = cloud_of(random);
  const std::vector<Ray> rays = rays_into(*scene, random, 3000);
  std::vector<std::size_t> order(rays.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  for (std::size_t i = order.size(); i > 1; --i)
    std::swap(order[i - 1], order[random.below(std::uint32_t(i))]);
  std::vector<Ray> shuffled;
  for (const std::size_t i : order) shuffled.push_back(rays[i]);
  AllHitsOptions options;
  options.max_hits = 5;
  const HitLists lists = all_hits(*scene, rows_of(rays), options);
  const HitLists others = all_hits(*scene, rows_of(shuffled), options);
  std::size_t truncated = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::size_t i = order[k];
    ASSERT_EQ(lists.status[i], others.status[k]);
    truncated += std::size_t(lists.status[i] == RayStatus::kTruncated);
    const std::uint64_t size = lists.splits[i + 1] - lists.splits[i];
    ASSERT_EQ(others.splits[k + 1] - others.splits[k], size);
    for (std::uint64_t j = 0; j < size; ++j) {
      ASSERT_EQ(lists.hits.t[lists.splits[i] + j], others.hits.t[others.splits[k] + j]);
      ASSERT_EQ(lists.hits.primitive_id[lists.splits[i] + j], others.hits.primitive_id[others.splits[k] + j]);
    }
  }
  EXPECT_GT(truncated, 100U);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_TRUE(same_lists(lists, all_hits(*scene, rows_of(rays), options)));
}

TEST(AllHits, the_closest_hit_again_and_again_gives_the_list) {
  test::Random random(test::seed_or(55));
  const auto scene = cloud_of(random);
  const std::vector<Ray> rays = rays_into(*scene, random, 400);
  const HitLists lists = all_hits(*scene, rows_of(rays));
  std::size_t steps = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    Ray rest = rays[i];
    std::uint64_t row = lists.splits[i];
    for (;;) {
      const SurfaceHit closest = intersect(*scene, rest);
      if (closest.status != RayStatus::kHit) break;
      ASSERT_LT(row, lists.splits[i + 1]);
      ASSERT_EQ(lists.hits.t[row], closest.t);
      ASSERT_EQ(lists.hits.instance_id[row], closest.instance_id);
      ASSERT_EQ(lists.hits.primitive_id[row], closest.primitive_id);
      // What shares its t follows it in the list, and does not come again.
      while (row < lists.splits[i + 1] && lists.hits.t[row] == closest.t) ++row;
      rest.tnear = std::nextafter(closest.t, std::numeric_limits<double>::infinity());
      ++steps;
    }
    ASSERT_EQ(row, lists.splits[i + 1]);
  }
  EXPECT_GT(steps, 500U);
}

TEST(AllHits, fast_lists_page_and_begin_with_the_fast_closest_hit_on_every_structure) {
  test::Random random(test::seed_or(56));
  SceneData data = meshes_only();
  for (int i = 0; i < 40; ++i) place(data, random.below(4), random_affine(random, 3.0, 0.5));
  std::vector<Ray> rays;
  HitLists first;
  for (const blas::StructureKind kind : kKinds) {
    SceneBuildOptions build;
    build.blas.kind = kind;
    const auto scene = built(data, build);
    AllHitsOptions options;
    options.precision = Precision::kFast;
    if (rays.empty()) {
      rays = rays_into(*scene, random, 500);
      first = all_hits(*scene, rows_of(rays), options);
    }
    const HitLists lists = all_hits(*scene, rows_of(rays), options);
    ASSERT_TRUE(same_lists(first, lists)) << int(kind);
    std::vector<HitPosition> after(rays.size());
    std::vector<std::uint64_t> row(lists.splits.begin(), lists.splits.end() - 1);
    options.max_hits = 3;
    options.after = after;
    for (int page = 0; page < 4; ++page) {
      const HitLists part = all_hits(*scene, rows_of(rays), options);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        for (std::uint64_t j = part.splits[i]; j < part.splits[i + 1]; ++j, ++row[i]) {
          ASSERT_EQ(part.hits.t[j], lists.hits.t[row[i]]);
          ASSERT_EQ(part.hits.instance_id[j], lists.hits.instance_id[row[i]]);
          ASSERT_EQ(part.hits.primitive_id[j], lists.hits.primitive_id[row[i]]);
          after[i] = {part.hits.t[j], part.hits.instance_id[j], part.hits.primitive_id[j]};
        }
      }
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(row[i], std::min(lists.splits[i + 1], lists.splits[i] + 12)) << "four pages of three";
      if (lists.status[i] != RayStatus::kHit) continue;
      ASSERT_EQ(lists.hits.t[lists.splits[i]], intersect(*scene, rays[i], Precision::kFast).t);
    }
  }
}

}  // namespace
}  // namespace gridcast::scene
