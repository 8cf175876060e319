// Whatever way a batch chooses, its answers are those of single rays, in the caller's order, bit for bit.

#include <algorithm>
#include <chrono>
#include <numeric>
#include <thread>

#include <tbb/task_arena.h>

#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

struct Batch {
  std::vector<Ray> rays;
  std::vector<PrimitiveRef> excluded;
};

std::vector<double> rows_of(const std::vector<Ray>& rays) {
  std::vector<double> rows;
  for (const Ray& ray : rays) {
    for (int c = 0; c < 3; ++c) rows.push_back(ray.origin[c]);
    rows.push_back(ray.tnear);
    for (int c = 0; c < 3; ++c) rows.push_back(ray.direction[c]);
    rows.push_back(ray.tfar);
  }
  return rows;
}

std::shared_ptr<const Scene> one_instance(const Affine& where, const SceneBuildOptions& options = {}) {
  SceneData data;
  data.meshes = {test::share(test::jittered_icosphere(4, 5))};
  place(data, 0, where);
  return built(std::move(data), options);
}

std::shared_ptr<const Scene> many_instances(test::Random& random) {
  SceneData data = meshes_only();
  for (int i = 0; i < 60; ++i) place(data, random.below(4), random_affine(random, 4.0, 0.5));
  return built(std::move(data));
}

/// Camera rays in scanline order through the scene's middle.
Batch camera_rays(const Scene& scene, std::size_t count, test::Random& random) {
  Batch batch;
  const Vec3d center = scene.bounds().center();
  const double size = max_abs(scene.bounds().extent());
  const Vec3d eye = center + 1.5 * size * random.direction();
  const Vec3d forward = glm::normalize(center - eye);
  const Vec3d right = glm::normalize(glm::cross(forward, Vec3d(0.3, 0.9, 0.1)));
  const Vec3d up = glm::cross(right, forward);
  const auto width = std::size_t(std::max(1.0, std::sqrt(double(count))));
  for (std::size_t i = 0; i < count; ++i) {
    const double x = 0.2 * (double(i % width) / double(width) - 0.5);
    const double y = 0.2 * (double(i / width) / double(width) - 0.5);
    batch.rays.push_back({eye, forward + x * right + y * up});
  }
  return batch;
}

/// Rays to one light from where camera rays hit, which they may not hit again.
Batch shadow_rays(const Scene& scene, std::size_t count, test::Random& random) {
  Batch batch;
  const Vec3d light = scene.bounds().center() + 3.0 * max_abs(scene.bounds().extent()) * random.direction();
  for (const Ray& ray : camera_rays(scene, count, random).rays) {
    const SurfaceHit hit = intersect(scene, ray);
    const Vec3d point = ray.origin + (hit.status == RayStatus::kHit ? hit.t : 1.0) * ray.direction;
    batch.rays.push_back({point, light - point, 0.0, 1.0});
    batch.excluded.push_back({hit.instance_id, hit.primitive_id});
  }
  return batch;
}

Batch mixed_rays(const Scene& scene, std::size_t count, test::Random& random) {
  Batch batch = camera_rays(scene, count, random);
  for (Ray& ray : batch.rays) {
    switch (random.below(40)) {
      case 0:
        ray.direction = Vec3d(0.0);
        break;
      case 1:
        ray.origin.y = std::numeric_limits<double>::quiet_NaN();
        break;
      case 2:
        ray.tfar = random.uniform(0.0, 3.0) * max_abs(scene.bounds().extent());
        break;
      case 3:
        ray.tnear = random.uniform(-1.0, 3.0) * max_abs(scene.bounds().extent());
        break;
      case 4:
        ray = random_ray(scene, random);
        break;
      case 5:
        ray.direction *= random.uniform(0.1, 10.0);
        break;
      default:
        break;
    }
  }
  return batch;
}

Batch random_rays(const Scene& scene, std::size_t count, test::Random& random) {
  Batch batch;
  for (std::size_t i = 0; i < count; ++i) batch.rays.push_back(random_ray(scene, random));
  return batch;
}

Batch shuffled(Batch batch, test::Random& random) {
  for (std::size_t i = batch.rays.size(); i > 1; --i) {
    const std::size_t other = random.bits() % i;
    std::swap(batch.rays[i - 1], batch.rays[other]);
    if (!batch.excluded.empty()) std::swap(batch.excluded[i - 1], batch.excluded[other]);
  }
  return batch;
}

TraceStats expect_answers_of_single_rays(const Scene& scene, const Batch& batch, Precision precision,
                                         int threads) {
  const std::vector<double> rows = rows_of(batch.rays);
  const RayBatch view{std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, batch.excluded};
  TraceStats stats;
  TraceStats any_stats;
  TraceOptions options;
  options.precision = precision;
  Result<HitColumns> hits = HitColumns{};
  Result<std::vector<RayStatus>> shadows = std::vector<RayStatus>{};
  tbb::task_arena arena(threads);
  arena.execute([&] {
    options.stats = &stats;
    hits = intersect(scene, view, options);
    options.stats = &any_stats;
    shadows = occluded(scene, view, options);
  });
  EXPECT_TRUE(hits.ok() && shadows.ok());
  HitColumns expected;
  expected.resize(batch.rays.size(), HitField::kAll);
  std::vector<RayStatus> any(batch.rays.size());
  std::uint64_t valid = 0;
  for (std::size_t i = 0; i < batch.rays.size(); ++i) {
    const PrimitiveRef excluded = batch.excluded.empty() ? PrimitiveRef{} : batch.excluded[i];
    expected.set(i, intersect(scene, batch.rays[i], precision, excluded));
    any[i] = occluded(scene, batch.rays[i], precision, excluded);
    valid += std::uint64_t(is_valid(batch.rays[i]));
  }
  EXPECT_EQ(hits->status, expected.status);
  EXPECT_EQ(hits->t, expected.t);
  EXPECT_EQ(hits->uv, expected.uv);
  EXPECT_EQ(hits->normal, expected.normal);
  EXPECT_EQ(hits->instance_id, expected.instance_id);
  EXPECT_EQ(hits->mesh_id, expected.mesh_id);
  EXPECT_EQ(hits->primitive_id, expected.primitive_id);
  EXPECT_EQ(*shadows, any);
  EXPECT_EQ(stats.packet_rays + stats.single_rays, valid);
  EXPECT_EQ(any_stats.packet_rays + any_stats.single_rays, valid);
  return stats;
}

TEST(SceneBatch, ragged_counts_of_every_kind_give_the_answers_of_single_rays) {
  test::Random random(test::seed_or(61));
  const auto one = one_instance(random_affine(random, 2.0, 1.0));
  const auto many = many_instances(random);
  for (std::size_t count = 1; count <= 99; ++count) {
    SCOPED_TRACE(count);
    const Scene& scene = count % 3 == 0 ? *many : *one;
    const auto precision = count % 2 == 0 ? Precision::kRobust : Precision::kFast;
    expect_answers_of_single_rays(scene, camera_rays(scene, count, random), precision, 2);
    expect_answers_of_single_rays(scene, mixed_rays(scene, count, random), precision, 1);
    expect_answers_of_single_rays(scene, shadow_rays(scene, count, random), precision, 2);
    expect_answers_of_single_rays(scene, random_rays(scene, count, random), precision, 2);
    if (::testing::Test::HasFailure()) return;
  }
}

TEST(SceneBatch, large_batches_sorted_or_not_give_the_answers_of_single_rays) {
  test::Random random(test::seed_or(62));
  for (const auto& scene :
       {one_instance({}), one_instance(random_affine(random, 5.0, 2.0)), many_instances(random)}) {
    for (const int threads : {1, 2}) {
      constexpr std::size_t kCount = 9000;
      for (const Batch& batch : {camera_rays(*scene, kCount, random), mixed_rays(*scene, kCount, random),
                                 shadow_rays(*scene, kCount, random), random_rays(*scene, kCount, random)}) {
        expect_answers_of_single_rays(*scene, batch, Precision::kRobust, threads);
        expect_answers_of_single_rays(*scene, shuffled(batch, random), Precision::kRobust, threads);
      }
      if (::testing::Test::HasFailure()) return;
    }
  }
}

TEST(SceneBatch, the_way_chosen_suits_the_rays) {
  test::Random random(test::seed_or(63));
  const auto scene = one_instance({});
  constexpr std::size_t kCount = 40000;
  const auto stats_of = [&](const Batch& batch, const Scene& in) {
    return expect_answers_of_single_rays(in, batch, Precision::kRobust, 2);
  };
  const Batch camera = camera_rays(*scene, kCount, random);
  const TraceStats in_order = stats_of(camera, *scene);
  EXPECT_EQ(in_order.order, RayOrderKind::kAsGiven);
  EXPECT_GT(in_order.packet_rays, 4 * in_order.single_rays);
  EXPECT_EQ(in_order.reason, "neighbours go the same way");

  const TraceStats from_one_point = stats_of(shuffled(camera, random), *scene);
  EXPECT_EQ(from_one_point.order, RayOrderKind::kByDirection);
  EXPECT_GT(from_one_point.packet_rays, from_one_point.single_rays);

  // One small wide tree is in the caches: its rays hide what little they wait for.
  const Batch anywhere = shuffled(random_rays(*scene, kCount, random), random);
  EXPECT_EQ(stats_of(anywhere, *scene).order, RayOrderKind::kAsGiven);
  const auto other_tree = one_instance({}, {{blas::StructureKind::kKdTree}, {}, {}});
  const TraceStats strangers = stats_of(anywhere, *other_tree);
  EXPECT_EQ(strangers.order, RayOrderKind::kByOrigin);
  EXPECT_EQ(to_string(strangers.order), "by_origin");
  EXPECT_GT(strangers.single_rays, strangers.packet_rays);
}

TEST(SceneBatch, pieces_go_into_their_rows_of_the_whole_and_into_no_other) {
  test::Random random(test::seed_or(65));
  const auto scene = one_instance(random_affine(random, 2.0, 1.0));
  const HitField fields = HitField::kAll | HitField::kTError;
  for (const bool sorted : {false, true}) {
    constexpr std::size_t kCount = 20000, kBefore = 3, kAfter = 5;
    const Batch camera = camera_rays(*scene, kCount, random);
    const std::vector<double> rows = rows_of(sorted ? shuffled(camera, random).rays : camera.rays);
    const RayBatch batch{std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, {}};
    TraceStats stats;
    TraceOptions options;
    options.fields = fields;
    options.stats = &stats;
    const auto expected = intersect(*scene, batch, options);
    const auto blocked = occluded(*scene, batch, options);
    ASSERT_TRUE(expected.ok() && blocked.ok());
    EXPECT_EQ(stats.order != RayOrderKind::kAsGiven, sorted);

    HitColumns hits;
    hits.resize(kBefore + kCount + kAfter, fields);
    std::vector<RayStatus> status(kBefore + kCount + kAfter, RayStatus::kTruncated);
    ASSERT_TRUE(intersect_into(*scene, batch, options, hits, kBefore).ok());
    ASSERT_TRUE(occluded_into(*scene, batch, options, std::span(status).subspan(kBefore, kCount)).ok());
    const auto expect_part = [](const auto& whole, const auto& part, auto around, std::size_t width = 1) {
      const auto first = whole.begin() + std::ptrdiff_t(kBefore * width),
                 last = first + std::ptrdiff_t(kCount * width);
      const auto is_untouched = [&](const auto& value) { return value == around; };
      EXPECT_TRUE(std::equal(first, last, part.begin(), part.end()));
      EXPECT_TRUE(std::all_of(whole.begin(), first, is_untouched) &&
                  std::all_of(last, whole.end(), is_untouched));
    };
    expect_part(hits.status, expected->status, RayStatus::kMiss);
    expect_part(hits.t, expected->t, std::numeric_limits<double>::infinity());
    expect_part(hits.uv, expected->uv, 0.F, 2);
    expect_part(hits.normal, expected->normal, 0.F, 3);
    expect_part(hits.instance_id, expected->instance_id, kInvalidId);
    expect_part(hits.mesh_id, expected->mesh_id, kInvalidId);
    expect_part(hits.primitive_id, expected->primitive_id, kInvalidId);
    expect_part(hits.t_error, expected->t_error, std::numeric_limits<double>::infinity());
    expect_part(status, *blocked, RayStatus::kTruncated);
  }
}

TEST(SceneBatch, a_batch_of_invalid_rays_alone_is_answered) {
  test::Random random(test::seed_or(64));
  const auto scene = one_instance({});
  Batch batch;
  batch.rays.assign(20000, Ray{Vec3d(0.0), Vec3d(0.0)});
  const TraceStats stats = expect_answers_of_single_rays(*scene, batch, Precision::kRobust, 2);
  EXPECT_EQ(stats.packet_rays + stats.single_rays, 0U);
}

// A ray from 2^42 sizes of the mesh away may take a tenth of a second, since no box can be told from another.
TEST(SceneBatch, a_stop_is_seen_between_the_rays_of_a_task) {
  SceneData data;
  data.meshes = {test::share(test::jittered_icosphere(5, 5))};
  place(data, 0, {});
  const auto scene = built(std::move(data));
  test::Random random(test::seed_or(93));
  std::vector<Ray> rays;
  for (int i = 0; i < 1500; ++i) {
    const Vec3d origin = 0x1p42 * random.direction();
    rays.push_back({origin, random.in_box(0.5) - origin});
  }
  const std::vector<double> rows = rows_of(rays);
  RayBatch batch;
  batch.bytes = std::as_bytes(std::span(rows));
  std::stop_source stop;
  TraceStats stats;
  TraceOptions options;
  options.stop = stop.get_token();
  options.stats = &stats;
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    stop.request_stop();
  });
  const auto hits = intersect(*scene, batch, options);
  stopper.join();
  ASSERT_FALSE(hits.ok());
  EXPECT_EQ(hits.error().code, ErrorCode::kCancelled);
  EXPECT_LT(stats.single_rays + stats.packet_rays, rays.size());
}

}  // namespace
}  // namespace gridcast::scene
