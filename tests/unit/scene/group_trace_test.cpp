// Rays that walk together get the answers of single rays, bit for bit, whatever they come to.

#include "core/scene/group_trace.h"

#include <chrono>
#include <thread>

#include "core/scene/update.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

/// Cameras near and far, so that some packets form, rays that start on what those hit, invalid ones, others.
RayRun rays_for(const Scene& scene, std::size_t count, test::Random& random) {
  RayRun run;
  const double size = max_abs(scene.bounds().extent());
  while (run.rays.size() < count) {
    const Ray middle = random_ray(scene, random);
    const double spread = std::exp2(random.uniform(-14.0, -3.0)) * max_abs(middle.direction);
    for (std::uint32_t i = 0; i < 20; ++i) {
      Ray ray = middle;
      ray.direction += spread * random.in_box(1.0);
      if (random.below(4) == 0) ray = random_ray(scene, random);
      if (random.below(30) == 0) ray.direction = Vec3d(0.0);
      if (random.below(30) == 0) ray.tnear = std::numeric_limits<double>::quiet_NaN();
      if (random.below(20) == 0) ray.tnear = random.uniform(-1.0, 1.0) * size;
      const SurfaceHit hit = intersect(scene, ray);
      const bool bounces = hit.status == RayStatus::kHit && random.below(3) == 0;
      if (bounces) ray.origin += hit.t * ray.direction;
      run.rays.push_back(ray);
      run.excluded.push_back(bounces ? PrimitiveRef{hit.instance_id, hit.primitive_id} : PrimitiveRef{});
    }
  }
  return run;
}

void expect_same(const Hit& hit, const SurfaceHit& expected) {
  EXPECT_EQ(hit.t, expected.t);
  EXPECT_EQ(hit.u, expected.u);
  EXPECT_EQ(hit.v, expected.v);
  EXPECT_EQ(hit.instance_id, expected.instance_id);
  EXPECT_EQ(hit.primitive_id, expected.primitive_id);
}

/// Traces the run in groups and ray by ray; returns how many rays were in packets.
template <Precision kPrecision>
std::uint64_t expect_answers_of_single_rays(const Scene& scene, RayRun run, InstanceMask mask) {
  BatchTarget target(scene, mask);
  target.grouping = Grouping::kAlways;
  RayRun any = run;
  EXPECT_TRUE((trace_run<kPrecision, false>(target, run, {})));
  EXPECT_TRUE((trace_run<kPrecision, true>(target, any, {})));
  std::uint64_t valid = 0;
  for (std::size_t i = 0; i < run.rays.size(); ++i) {
    SCOPED_TRACE(i);
    const SurfaceHit expected = intersect(scene, run.rays[i], kPrecision, run.excluded[i], mask);
    EXPECT_EQ(run.status[i], expected.status);
    if (expected.status == RayStatus::kHit) expect_same(run.hits[i], expected);
    EXPECT_EQ(any.status[i], occluded(scene, run.rays[i], kPrecision, run.excluded[i], mask));
    valid += std::uint64_t(is_valid(run.rays[i]));
  }
  EXPECT_EQ(run.packet_rays + run.single_rays, valid);
  EXPECT_EQ(any.packet_rays + any.single_rays, valid);
  return run.packet_rays;
}

/// Of all precisions.
std::uint64_t expect_answers_of_single_rays(const Scene& scene, const RayRun& run, InstanceMask mask) {
  return expect_answers_of_single_rays<Precision::kFast>(scene, run, mask) +
         expect_answers_of_single_rays<Precision::kRobust>(scene, run, mask) +
         expect_answers_of_single_rays<Precision::kExact>(scene, run, mask);
}

/// Masks of all kinds, and transforms that nothing can be hit through.
SceneData with_hidden_instances(SceneData data, test::Random& random) {
  for (auto& instance : data.instances) {
    if (random.below(8) == 0) instance.world_from_object.linear[1] = Vec3d(0.0);
  }
  return data;
}

TEST(SceneGroups, awkward_scenes_give_the_answers_of_single_rays) {
  test::Random random(test::seed_or(71));
  std::uint64_t packets = 0;
  for (auto& [name, data] : awkward_scenes(300, random)) {
    SCOPED_TRACE(name);
    for (const auto kind : {blas::StructureKind::kWideBvh, blas::StructureKind::kKdTree}) {
      const auto scene = built(with_hidden_instances(data, random), {{kind}, {}, {}});
      packets += expect_answers_of_single_rays(*scene, rays_for(*scene, 300, random), kFullMask);
    }
    if (::testing::Test::HasFailure()) return;
  }
  EXPECT_GT(packets, 100U);
}

TEST(SceneGroups, a_mask_hides_instances_from_all_rays_of_a_group) {
  test::Random random(test::seed_or(72));
  const auto scene = start_scene(random, 80);
  std::vector<SceneEdit> edits;
  for (std::uint32_t id = 0; id < 80; ++id) {
    ChangeInstance change;
    change.instance_id = id;
    change.mask = InstanceMask(random.below(4));
    edits.emplace_back(change);
  }
  const auto masked = apply_update(*scene, edits);
  ASSERT_TRUE(masked.ok());
  for (const int mask : {1, 2, 3, 255})
    expect_answers_of_single_rays(*masked->scene, rays_for(*masked->scene, 300, random), InstanceMask(mask));
}

/// Eight large instances side by side, seen from outside.
std::shared_ptr<const Scene> eight_bodies() {
  SceneData data;
  data.meshes = {test::share(test::jittered_icosphere(5, 5))};
  data.deformations.resize(1);
  for (int i = 0; i < 8; ++i) place(data, 0, {Mat3d(1.0), 2.5 * Vec3d(i % 2, i / 2 % 2, i / 4)});
  return built(std::move(data), {{blas::StructureKind::kWideBvh}, {}, {}});
}

RayRun picture(std::size_t width, std::size_t lines) {
  RayRun run;
  for (std::size_t i = 0; i < width * lines; ++i) {
    const double x = double(i % width) / double(width) - 0.5, y = double(i / width) / double(width) - 0.1;
    run.rays.push_back({{1.2, 1.1, -9.0}, {0.5 * x, 0.5 * y, 1.0}});
    run.excluded.emplace_back();
  }
  return run;
}

TEST(SceneGroups, packets_form_at_instances_where_neighbours_are_close_and_not_where_they_are_not) {
  const auto scene = eight_bodies();
  EXPECT_GT(expect_answers_of_single_rays(*scene, picture(1200, 2), kFullMask), 3000U);

  const BatchTarget target(*scene, kFullMask);
  EXPECT_EQ(target.grouping, Grouping::kWherePacketsForm);
  RayRun fine = picture(1200, 2), coarse = picture(60, 40);
  ASSERT_TRUE((trace_run<Precision::kRobust, false>(target, fine, {})));
  ASSERT_TRUE((trace_run<Precision::kRobust, false>(target, coarse, {})));
  EXPECT_GT(fine.packet_rays, fine.rays.size() / 3);
  EXPECT_LT(coarse.packet_rays, coarse.rays.size() / 10);
}

TEST(SceneGroups, a_large_top_level_is_walked_in_groups_and_no_packets_are_known) {
  SceneData data = meshes_only();
  test::Random random(test::seed_or(73));
  for (int i = 0; i < 60'000; ++i) place(data, 2, {Mat3d(0.1), random.in_box(50.0)});
  const auto scene = built(std::move(data), {{blas::StructureKind::kKdTree}, {}, {}});
  EXPECT_EQ(BatchTarget(*scene, kFullMask).grouping, Grouping::kNever);
  EXPECT_EQ(BatchTarget(*scene, kFullMask, RayOrderKind::kByOrigin).grouping, Grouping::kAlways);
  expect_answers_of_single_rays(*scene, rays_for(*scene, 600, random), kFullMask);

  std::vector<Vec3d> rows;
  for (int i = 0; i < 10'000; ++i) {
    const Ray ray = random_ray(*scene, random);
    rows.insert(rows.end(), {ray.origin, ray.direction});
  }
  TraceStats stats;
  TraceOptions options;
  options.stats = &stats;
  ASSERT_TRUE(intersect(*scene, {std::as_bytes(std::span(rows)), ScalarType::kFloat64, 6, {}}, options).ok());
  EXPECT_EQ(stats.reason, "neighbours start far apart; in groups, as the top level is large");
}

// From 2^42 sizes away no box can be told from another, so every ray visits all instances.
TEST(SceneGroups, a_stop_is_seen_among_the_visits_of_a_group) {
  test::Random random(test::seed_or(74));
  const auto scene = eight_bodies();
  BatchTarget target(*scene, kFullMask);
  target.grouping = Grouping::kAlways;
  RayRun run;
  for (int i = 0; i < 1500; ++i) {
    const Vec3d origin = 0x1p42 * random.direction();
    run.rays.push_back({origin, random.in_box(0.5) - origin});
  }
  std::stop_source stop;
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    stop.request_stop();
  });
  EXPECT_FALSE((trace_run<Precision::kRobust, false>(target, run, stop.get_token())));
  stopper.join();
  EXPECT_LT(run.packet_rays + run.single_rays, run.rays.size());
  EXPECT_FALSE((trace_run<Precision::kRobust, true>(target, run, stop.get_token())));
}

}  // namespace
}  // namespace gridcast::scene
