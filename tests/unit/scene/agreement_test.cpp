// The two levels together give what testing every triangle of every instance gives.

#include "core/tlas/top_level.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

void expect_brute_force_answers(const Scene& scene, test::Random& random, int rays) {
  for (int i = 0; i < rays; ++i) {
    const Ray ray = random_ray(scene, random);
    for (const Precision precision : {Precision::kRobust, Precision::kFast}) {
      const Hit expected = brute_force(scene, ray, precision);
      const SurfaceHit found = intersect(scene, ray, precision);
      ASSERT_EQ(found.status == RayStatus::kHit, expected.valid());
      ASSERT_EQ(occluded(scene, ray, precision), found.status);
      if (!expected.valid()) continue;
      ASSERT_EQ(found.t, expected.t);
      ASSERT_EQ(found.u, expected.u);
      ASSERT_EQ(found.v, expected.v);
      ASSERT_EQ(found.instance_id, expected.instance_id);
      ASSERT_EQ(found.primitive_id, expected.primitive_id);
      ASSERT_NEAR(glm::length(found.normal), 1.0, 1e-12);
    }
  }
}

TEST(SceneAgreement, answers_equal_brute_force_bit_for_bit_in_awkward_scenes) {
  test::Random random(test::seed_or(31));
  for (auto& [name, data] : awkward_scenes(150, random)) {
    SCOPED_TRACE(name);
    const auto scene = built(std::move(data));
    const Status valid = scene->validate();
    ASSERT_TRUE(valid.ok()) << valid.error().message << valid.error().where;
    expect_brute_force_answers(*scene, random, 150);
  }
}

TEST(SceneAgreement, small_scenes_of_any_size_up_to_20_agree) {
  test::Random random(test::seed_or(32));
  for (int count = 0; count <= 20; ++count) {
    SceneData data = meshes_only();
    for (int i = 0; i < count; ++i) place(data, random.below(4), random_affine(random, 3.0, 0.5));
    const auto scene = built(std::move(data));
    if (count == 0) {
      EXPECT_EQ(intersect(*scene, {}).status, RayStatus::kMiss);
    } else {
      expect_brute_force_answers(*scene, random, 40);
    }
  }
}

TEST(SceneAgreement, ill_conditioned_and_extreme_scales_agree) {
  test::Random random(test::seed_or(33));
  SceneData data = meshes_only();
  for (int i = 0; i < 120; ++i) {
    Affine where = random_affine(random, 5.0, 0.5);
    const double flat = std::exp2(-double(i % 30));
    where.linear = where.linear * Mat3d(1, 0, 0, 0, 1, 0, 0, 0, flat);
    if (i % 7 == 0) where.linear = where.linear * 1e-6;
    if (i % 31 == 0) where.linear = where.linear * 1e3;
    place(data, random.below(4), where);
  }
  const auto scene = built(std::move(data));
  expect_brute_force_answers(*scene, random, 400);
}

TEST(SceneTrace, batches_give_the_answers_of_single_rays_in_order) {
  test::Random random(test::seed_or(34));
  SceneData data = meshes_only();
  for (int i = 0; i < 300; ++i) place(data, random.below(4), random_affine(random, 8.0, 0.5));
  const auto scene = built(std::move(data));
  std::vector<double> rows;
  std::vector<Ray> rays;
  for (int i = 0; i < 10000; ++i) {
    Ray ray = random_ray(*scene, random);
    if (i % 100 == 7) ray.direction = Vec3d(0.0);
    if (i % 100 == 8) ray.origin.y = std::numeric_limits<double>::quiet_NaN();
    rays.push_back(ray);
    for (int c = 0; c < 3; ++c) rows.push_back(ray.origin[c]);
    rows.push_back(ray.tnear);
    for (int c = 0; c < 3; ++c) rows.push_back(ray.direction[c]);
    rows.push_back(ray.tfar);
  }
  std::atomic<int> reports = 0;
  TraceOptions options;
  options.progress = [&](double fraction) {
    ++reports;
    EXPECT_LE(fraction, 1.0);
  };
  const RayBatch batch{std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, {}};
  const auto hits = intersect(*scene, batch, options);
  const auto shadows = occluded(*scene, batch, options);
  ASSERT_TRUE(hits.ok());
  ASSERT_TRUE(shadows.ok());
  EXPECT_GT(reports, 2);
  HitColumns expected;
  expected.resize(rays.size(), HitField::kAll);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    expected.set(i, intersect(*scene, rays[i]));
    EXPECT_EQ((*shadows)[i], expected.status[i]);
    const bool invalid = i % 100 == 7 || i % 100 == 8;
    EXPECT_EQ(expected.status[i] == RayStatus::kInvalid, invalid);
  }
  EXPECT_EQ(hits->status, expected.status);
  EXPECT_EQ(hits->t, expected.t);
  EXPECT_EQ(hits->uv, expected.uv);
  EXPECT_EQ(hits->normal, expected.normal);
  EXPECT_EQ(hits->instance_id, expected.instance_id);
  EXPECT_EQ(hits->mesh_id, expected.mesh_id);
  EXPECT_EQ(hits->primitive_id, expected.primitive_id);
}

TEST(SceneTrace, a_stopped_batch_is_cancelled) {
  SceneData data = meshes_only();
  place(data, 0, {});
  const auto scene = built(std::move(data));
  const std::vector<double> rows(6 * 100000, 1.0);
  std::stop_source stop;
  stop.request_stop();
  TraceOptions options;
  options.stop = stop.get_token();
  const auto hits =
      intersect(*scene, RayBatch{std::as_bytes(std::span(rows)), ScalarType::kFloat64, 6, {}}, options);
  ASSERT_FALSE(hits.ok());
  EXPECT_EQ(hits.error().code, ErrorCode::kCancelled);
}

TEST(SceneTrace, the_excluded_primitive_of_one_instance_is_never_hit) {
  SceneData data;
  data.meshes.push_back(test::share(test::single_triangle()));
  place(data, 0, {});
  place(data, 0, {Mat3d(1.0), Vec3d(0, 0, -1)});
  const auto scene = built(std::move(data));
  const Ray ray{{0.25, 0.25, 1}, {0, 0, -1}};
  EXPECT_EQ(intersect(*scene, ray).instance_id, 0U);
  const SurfaceHit behind = intersect(*scene, ray, Precision::kRobust, {0, 0});
  EXPECT_EQ(behind.instance_id, 1U);
  EXPECT_EQ(behind.t, 2.0);
  Ray segment = ray;
  segment.tfar = 1.5;
  EXPECT_EQ(occluded(*scene, segment, Precision::kRobust, {0, 0}), RayStatus::kMiss);
}

TEST(SceneTrace, t_does_not_change_under_powers_of_two_and_offsets_cost_nothing) {
  test::Random random(test::seed_or(35));
  const Vec3d offset(1e6, -1e6, 1048576.0);
  for (int i = 0; i < 40; ++i) {
    // Multiples of 2^-20 stay exact when a million is added.
    const auto coarse = [](const Vec3d& v) { return glm::round(v * 0x1p20) * 0x1p-20; };
    const Affine here = {random_affine(random, 0.0, 1.0).linear, coarse(random.in_box(2.0))};
    const Vec3d origin = coarse(random.in_box(6.0));
    const Vec3d direction = coarse(here.translation + random.in_box(0.7) - origin);
    const auto trace = [&](const Affine& where, const Vec3d& from, const Vec3d& towards) {
      SceneData data = meshes_only();
      place(data, 0, where);
      return intersect(*built(std::move(data)), {from, towards});
    };
    const SurfaceHit hit = trace(here, origin, direction);
    const SurfaceHit moved = trace({here.linear, here.translation + offset}, origin + offset, direction);
    EXPECT_TRUE(same(hit, moved));
    const double s = 0x1p12;
    const SurfaceHit scaled = trace({here.linear * s, here.translation * s}, origin * s, direction * s);
    EXPECT_TRUE(same(hit, scaled));
  }
}

TEST(SceneTrace, the_normal_follows_the_winding_in_object_space_even_when_mirrored) {
  SceneData data;
  data.meshes.push_back(test::share(test::single_triangle()));
  place(data, 0, {Mat3d(-1, 0, 0, 0, 1, 0, 0, 0, 1), Vec3d(0.0)});
  place(data, 0, {Mat3d(2, 0, 0, 0, 3, 0, 0, 0, 0.1), Vec3d(10, 0, 0)});
  const auto scene = built(std::move(data));
  EXPECT_EQ(intersect(*scene, {{-0.25, 0.25, 1}, {0, 0, -1}}).normal, Vec3d(0, 0, 1));
  EXPECT_EQ(intersect(*scene, {{10.5, 0.5, 1}, {0, 0, -1}}).normal, Vec3d(0, 0, 1));
}

}  // namespace
}  // namespace gridcast::scene
