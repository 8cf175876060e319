// Visibility against a look at every triangle, and of points that lie on surfaces.

#include "core/scene/visibility.h"

#include <cmath>
#include <limits>

#include "core/scene/made_rays.h"
#include "tests/unit/scene/list_fixture.h"

namespace gridcast::scene {
namespace {

std::vector<double> pair_rows(const std::vector<std::pair<Vec3d, Vec3d>>& pairs) {
  std::vector<double> rows;
  for (const auto& [a, b] : pairs) rows.insert(rows.end(), {a.x, a.y, a.z, b.x, b.y, b.z});
  return rows;
}
PairBatch pairs_of(const std::vector<double>& rows) {
  return {std::as_bytes(std::span(rows)), ScalarType::kFloat64, {}, {}};
}

/// Points around the scene, inside and outside.
std::vector<std::pair<Vec3d, Vec3d>> random_pairs(const Scene& scene, test::Random& random, int count) {
  const double size = max_abs(scene.bounds().extent());
  std::vector<std::pair<Vec3d, Vec3d>> pairs;
  for (int i = 0; i < count; ++i)
    pairs.emplace_back(scene.bounds().center() + random.in_box(0.6 * size),
                       scene.bounds().center() + random.in_box(0.4 * size));
  return pairs;
}

TEST(Visibility, the_first_blocker_is_that_of_a_look_at_every_triangle) {
  test::Random random(test::seed_or(71));
  for (const auto& [name, data] : awkward_scenes(40, random)) {
    const auto scene = built(data);
    const auto pairs = random_pairs(*scene, random, 150);
    const auto rows = pair_rows(pairs);
    for (const double margin : {0.0, 0.05 * max_abs(scene->bounds().extent())}) {
      const VisibilityOptions options{{}, margin};
      const auto blockers = first_blockers(*scene, pairs_of(rows), options);
      const auto status = blocked(*scene, pairs_of(rows), options);
      ASSERT_TRUE(blockers.ok() && status.ok());
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        const auto& [from, to] = pairs[i];
        const double end = margin == 0.0 ? 0.0 : margin / glm::length(to - from);
        const Hit hit = brute_force(*scene, {from, to - from, end, 1.0 - end}, Precision::kRobust);
        ASSERT_EQ(blockers->status[i], hit.valid() ? RayStatus::kHit : RayStatus::kMiss) << name << " " << i;
        ASSERT_EQ((*status)[i], blockers->status[i]) << name << " " << i;
        if (!hit.valid()) continue;
        ASSERT_EQ(blockers->t[i], hit.t) << name << " " << i;
        ASSERT_EQ(blockers->instance_id[i], hit.instance_id);
        ASSERT_EQ(blockers->primitive_id[i], hit.primitive_id);
      }
    }
  }
}

/// A point on a triangle of the scene, away from its edges, rounded to double.
std::pair<Vec3d, PrimitiveRef> surface_point(const Scene& scene, test::Random& random) {
  const std::uint32_t primitive = random.below(std::uint32_t(scene.blas(0).mesh().triangle_count()));
  const auto corners = scene.blas(0).mesh().corners(primitive);
  const double u = random.uniform(0.1, 0.4), v = random.uniform(0.1, 0.4);
  const Affine& place = scene.instance(0).transform.world_from_object();
  return {place.point((1 - u - v) * Vec3d(corners[0]) + u * Vec3d(corners[1]) + v * Vec3d(corners[2])),
          {0, primitive}};
}

TEST(Visibility, surface_points_of_a_convex_body_see_each_other_through_its_inside) {
  test::Random random(test::seed_or(72));
  SceneData data;
  data.meshes = {test::share(test::icosphere(2))};
  place(data, 0, random_affine(random, 100.0, 1.0));
  const auto scene = built(std::move(data));
  std::vector<std::pair<Vec3d, Vec3d>> pairs;
  std::vector<PrimitiveRef> excluded, targets;
  for (int i = 0; i < 2000; ++i) {
    const auto [from, from_on] = surface_point(*scene, random);
    const auto [to, to_on] = surface_point(*scene, random);
    if (from_on == to_on) continue;
    pairs.emplace_back(from, to);
    excluded.push_back(from_on);
    targets.push_back(to_on);
  }
  const auto rows = pair_rows(pairs);
  const auto count_blocked = [&](const PairBatch& batch, double margin, Precision precision) {
    const auto status = blocked(*scene, batch, {{precision, {}, {}, {}, nullptr}, margin});
    EXPECT_TRUE(status.ok());
    return std::count(status->begin(), status->end(), RayStatus::kHit);
  };
  PairBatch named = pairs_of(rows);
  named.excluded = excluded;
  named.targets = targets;
  for (const Precision precision : {Precision::kRobust, Precision::kExact}) {
    EXPECT_EQ(count_blocked(named, 0.0, precision), 0);
    EXPECT_EQ(count_blocked(pairs_of(rows), 1e-9, precision), 0);
    EXPECT_GT(count_blocked(pairs_of(rows), 0.0, precision), 100)
        << "rounding puts points in front or behind";
  }
  named.targets = {};
  EXPECT_GT(count_blocked(named, 0.0, Precision::kRobust), 50);
  named.targets = targets;
  named.excluded = {};
  EXPECT_GT(count_blocked(named, 0.0, Precision::kRobust), 50);
}

TEST(Visibility, ends_on_a_surface_exactly_do_not_block_and_odd_pairs_have_an_answer) {
  SceneData data;
  data.meshes = {test::share(test::box({-1, -1, -1}, {1, 1, 1}))};
  place(data, 0, {});
  const auto scene = built(std::move(data));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto rows = pair_rows({{{1, 0.25, 0.5}, {5, 0, 0}},          // off a side
                               {{5, 0.25, 0.5}, {1, 0.25, 0.5}},     // onto it
                               {{1, 0.25, 0.5}, {-1, 0.5, 0.25}},    // through the inside, side to side
                               {{1, 0.25, 0.5}, {-1.5, 0.25, 0.5}},  // out of the other side
                               {{0, 0, 0}, {0, 0, 0}},               // the same point
                               {{nan, 0, 0}, {0, 0, 0}},
                               {{0, 0, 0}, {0, 1e300, 0}}});
  const auto answer = first_blockers(*scene, pairs_of(rows), {});
  ASSERT_TRUE(answer.ok());
  using enum RayStatus;
  EXPECT_EQ(answer->status, (std::vector{kMiss, kMiss, kMiss, kHit, kMiss, kInvalid, kInvalid}));
  EXPECT_EQ(answer->t[3], 0.8);
  EXPECT_EQ(first_blockers(*scene, pairs_of(rows), {{}, 0.4})->status[3], kHit);
  EXPECT_EQ(first_blockers(*scene, pairs_of(rows), {{}, 0.6})->status[3], kMiss);
  EXPECT_EQ(first_blockers(*scene, pairs_of(rows), {{}, 1e300})->status[3], kMiss);
}

TEST(MadeRays, answers_are_those_of_the_batch_across_pieces) {
  test::Random random(test::seed_or(73));
  const auto scene = start_scene(random, 12);
  std::vector<Ray> few;
  for (int i = 0; i < 1009; ++i) few.push_back(random_ray(*scene, random));
  few[5].direction = Vec3d(0.0);
  std::vector<Ray> all;
  for (std::size_t i = 0; i < (std::size_t(1) << 18) + 5000; ++i) all.push_back(few[i % few.size()]);
  std::vector<PrimitiveRef> excluded(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) excluded[i] = {std::uint32_t(i % 12), std::uint32_t(i % 60)};
  const auto rows = rows_of(all);
  RayBatch batch = batch_of(rows);
  batch.excluded = excluded;
  const MadeRays made{all.size(), [&](std::size_t i) { return all[i]; }, excluded};
  TraceStats stats;
  TraceOptions options;
  options.stats = &stats;
  const auto want = intersect(*scene, batch, {});
  const auto got = intersect(*scene, made, options);
  ASSERT_TRUE(want.ok() && got.ok());
  EXPECT_EQ(got->status, want->status);
  EXPECT_EQ(got->t, want->t);
  EXPECT_EQ(got->uv, want->uv);
  EXPECT_EQ(got->normal, want->normal);
  EXPECT_EQ(got->instance_id, want->instance_id);
  EXPECT_EQ(got->mesh_id, want->mesh_id);
  EXPECT_EQ(got->primitive_id, want->primitive_id);
  EXPECT_EQ(stats.packet_rays + stats.single_rays +
                std::size_t(std::ranges::count(want->status, RayStatus::kInvalid)),
            all.size());
  EXPECT_EQ(*occluded(*scene, made, {}), *occluded(*scene, batch, {}));
  std::stop_source stop;
  stop.request_stop();
  options.stop = stop.get_token();
  EXPECT_EQ(intersect(*scene, made, options).error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::scene
