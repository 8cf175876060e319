// The bound of t against exact rationals.

#include "core/scene/hit_error.h"

#include <algorithm>
#include <iostream>

#include "tests/support/hostile.h"
#include "tests/support/rational.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

std::shared_ptr<const Scene> scene_of(const test::HostileTriangle& triangle) {
  mesh::TriangleMesh mesh;
  mesh.positions = {triangle.corners.begin(), triangle.corners.end()};
  mesh.triangles = {{0, 1, 2}};
  SceneData data;
  data.meshes = {test::share(std::move(mesh))};
  data.deformations.resize(1);
  place(data, 0, triangle.transform.world_from_object());
  return built(std::move(data));
}

struct Tally {
  std::size_t hits = 0, uncovered = 0, unbounded = 0;
  std::vector<double> excess;  ///< bound / error, where there is an error

  void add(double t, double bound, const test::Rational& exact) {
    ++hits;
    if (std::isinf(bound)) {
      ++unbounded;
      return;
    }
    const test::Rational error = abs(test::Rational(t) - exact);
    uncovered += std::size_t(error > test::Rational(bound));
    if (error > 0) excess.push_back(bound / error.get_d());
  }
  double median() {
    std::sort(excess.begin(), excess.end());
    return excess.empty() ? 1.0 : excess[excess.size() / 2];
  }
};

template <class Ask>
Tally ask_hostile(int triangles, int rays, std::uint64_t seed, const Ask& ask) {
  test::Random random(seed);
  Tally tally;
  for (int i = 0; i < triangles; ++i) {
    const test::HostileTriangle triangle = test::hostile_triangle(random);
    const auto scene = scene_of(triangle);
    const test::RationalPlane plane(triangle.transform.world_from_object(), triangle.corners);
    for (int k = 0; k < rays; ++k) {
      const Ray ray = test::hostile_ray(triangle, random);
      SurfaceHit hit = ask(*scene, ray);
      if (hit.status != RayStatus::kHit) continue;
      const double bound = t_error(*scene, ray, hit);
      if (plane.slope(ray) == 0) {
        EXPECT_TRUE(std::isinf(bound));
      } else {
        tally.add(hit.t, bound, plane.t_of(ray));
      }
    }
  }
  std::cout << tally.hits << " hits, " << tally.unbounded << " without a bound, median bound / error "
            << tally.median() << "\n";
  return tally;
}

TEST(HitError, covers_every_hit_of_the_hostile_set_and_exceeds_it_by_next_to_nothing) {
  for (const Precision precision : {Precision::kRobust, Precision::kFast}) {
    Tally tally = ask_hostile(1500, 8, test::seed_or(81), [&](const Scene& scene, const Ray& ray) {
      return intersect(scene, ray, precision);
    });
    EXPECT_EQ(tally.uncovered, 0U);
    EXPECT_GT(tally.hits, 4000U);
    EXPECT_LT(tally.unbounded, tally.hits / 1000);
    EXPECT_LT(tally.median(), 1.0 + 1e-9);
  }
}

TEST(HitError, covers_whatever_t_a_method_comes_to) {
  test::Random noise(test::seed_or(82));
  Tally tally = ask_hostile(300, 8, test::seed_or(83), [&](const Scene& scene, const Ray& ray) {
    SurfaceHit hit = intersect(scene, ray);
    hit.t *= 1.0 + std::exp2(noise.uniform(-60.0, 0.0));
    return hit;
  });
  EXPECT_EQ(tally.uncovered, 0U);
  EXPECT_LT(tally.median(), 1.0 + 1e-9);
}

TEST(HitError, is_infinite_for_a_ray_in_the_plane) {
  SceneData data;
  data.meshes = {test::share(test::single_triangle())};
  data.deformations.resize(1);
  place(data, 0, {});
  const auto scene = built(std::move(data));
  SurfaceHit hit;
  hit.status = RayStatus::kHit;
  hit.t = 1.0;
  hit.instance_id = hit.mesh_id = hit.primitive_id = 0;
  EXPECT_TRUE(std::isinf(t_error(*scene, {{-1, 0.25, 0}, {1, 0, 0}}, hit)));
  EXPECT_TRUE(std::isinf(t_error(*scene, {{-1, 0.25, 1}, {1, 0, 0}}, hit)));
  EXPECT_LT(t_error(*scene, {{0.25, 0.25, 1}, {0, 0, -1}}, hit), 0x1p-95);
}

TEST(HitError, is_a_column_of_a_batch_where_asked_for) {
  test::Random random(test::seed_or(84));
  const auto scene = built(awkward_scenes(20, random).at("cloud"));
  std::vector<double> rows;
  std::vector<Ray> rays;
  for (int i = 0; i < 500; ++i) {
    rays.push_back(random_ray(*scene, random));
    const Ray& r = rays.back();
    rows.insert(rows.end(), {r.origin.x, r.origin.y, r.origin.z, r.tnear, r.direction.x, r.direction.y,
                             r.direction.z, r.tfar});
  }
  RayBatch batch;
  batch.bytes = std::as_bytes(std::span(rows));
  TraceOptions options;
  EXPECT_TRUE(intersect(*scene, batch, options)->t_error.empty());
  options.fields = HitField::kTError;
  const auto hits = intersect(*scene, batch, options);
  std::size_t bounded = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const SurfaceHit hit = intersect(*scene, rays[i]);
    const bool is_hit = hit.status == RayStatus::kHit;
    EXPECT_EQ(hits->t_error[i],
              is_hit ? t_error(*scene, rays[i], hit) : std::numeric_limits<double>::infinity());
    bounded += std::size_t(std::isfinite(hits->t_error[i]));
  }
  EXPECT_GT(bounded, 100U);
}

}  // namespace
}  // namespace gridcast::scene
