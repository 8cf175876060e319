// Triangles that tests of one triangle get wrong: without area, in the ray's plane, many times the same.

#include <gtest/gtest.h>

#include "core/scene/update.h"
#include "tests/stability/subject.h"
#include "tests/stability/truth.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::stability {
namespace {

using mesh::TriangleMesh;

/// A vector of small whole numbers, not all zero.
Vec3d whole_vector(test::Random& random, std::uint32_t most) {
  for (;;) {
    const Vec3d v(double(random.below(2 * most + 1)), double(random.below(2 * most + 1)),
                  double(random.below(2 * most + 1)));
    if (v != Vec3d(most)) return v - double(most);
  }
}

// Whole numbers and powers of two, so that the rays lie in the plane exactly.
TEST(Stability, RC10_RayInTheTrianglesPlane) {
  Row row(10, 12000);
  constexpr std::size_t kRaysPerTriangle = 60;
  row.blocks(row.rays() / kRaysPerTriangle + 1, [&](test::Random& random, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) {
      const Vec3d p0 = whole_vector(random, 9), first = whole_vector(random, 9),
                  second = whole_vector(random, 9);
      if (glm::cross(first, second) == Vec3d(0.0)) continue;
      const float scale = std::ldexp(1.F, int(random.below(41)) - 20);
      TriangleMesh mesh;
      mesh.positions = {scale * Vec3f(p0), scale * Vec3f(p0 + first), scale * Vec3f(p0 + second)};
      mesh.triangles = {{0, 1, 2}};
      const Subject subject(placed(given(mesh)));
      std::vector<Shot> shots;
      while (shots.size() < kRaysPerTriangle) {
        const double a = 0.25 * double(random.below(13)) - 1.0, b = 0.25 * double(random.below(13)) - 1.0;
        const double ways[][2] = {{1, 0},  {0, 1},      {1, -1},
                                  {-1, 2}, {0.5, 0.25}, {double(random.below(7)) - 3.0, 1}};
        const auto& way = ways[random.below(6)];  // the first three along a side
        const double sign = random.below(2) == 0 ? 1.0 : -1.0;
        Shot shot{{double(scale) * (p0 + a * first + b * second), sign * (way[0] * first + way[1] * second)},
                  {},
                  Expectation::miss()};
        if (random.below(3) == 0) shot.ray.tnear = -100.0;
        shots.push_back(shot);
      }
      (void)subject.ask(row, shots);
    }
  });
}

/// Exactly without area: three, two or no equal corners, on a lattice so that corners are collinear exactly.
void add_degenerate(TriangleMesh& mesh, test::Random& random) {
  const auto lattice = [&] { return Vec3f(glm::round(random.in_box(0.5) * 0x1p10) * 0x1p-10); };
  const auto first = std::uint32_t(mesh.positions.size());
  const Vec3f a = lattice(), b = lattice();
  mesh.positions.insert(mesh.positions.end(), {a, b, 0.5F * a + 0.5F * b});
  const mesh::Triangle kinds[] = {{first, first, first},         {first, first + 1, first},
                                  {first, first, first + 1},     {first, first + 1, first + 1},
                                  {first, first + 1, first + 2}, {first + 2, first, first + 1}};
  mesh.triangles.push_back(kinds[random.below(6)]);
}

TEST(Stability, RC11_DegenerateTriangles) {
  Row row(11, 8000);
  test::Random random(row.seed());
  // Good triangles first, so that they keep their numbers; the bounds stay the same too.
  const TriangleMesh good = test::jittered_icosphere(2, 11);
  TriangleMesh mixed = good, none;
  for (int i = 0; i < 1500; ++i) {
    add_degenerate(mixed, random);
    add_degenerate(none, random);
  }
  const Subject reference(placed(given(good)));
  Subject subject(placed(given(std::move(mixed))));
  Subject nothing(placed(given(std::move(none))));
  const WorldTruth truth(subject.spec());
  blas::RayMaker maker(*subject.spec().meshes[0].mesh, row.seed());
  row.blocks(row.rays(2), [&](test::Random&, std::size_t count) {
    std::vector<Shot> shots, misses;
    for (std::size_t i = 0; i < count; ++i) {
      const Ray ray = maker.any().ray;
      shots.push_back(truth.shot(reference.scene(), ray));
      misses.push_back({ray, {}, Expectation::miss()});
    }
    subject.shoot(row, shots);
    nothing.shoot(row, misses);
  });
}

/// Which of the two triangles of the unit square (quad_grid 1 1) a point is on, the first where both are.
std::uint32_t half_of(double x, double y) {
  return x + y <= 1.0 ? 0 : 1;
}

TEST(Stability, RC13_ExactTies) {
  Row row(13, 4000);
  // Copies of a square, in order and shuffled: the smallest number wins.
  for (const int copies : {2, 10, 1000, 50000}) {
    for (const bool shuffled : {false, true}) {
      const std::string spec =
          "quad_grid 1 1 | repeat " + std::to_string(copies) + (shuffled ? " | shuffle 13" : "");
      const MeshSource source = generated(spec);
      std::uint32_t smallest[2] = {0, 0};
      for (const std::uint32_t half : {0U, 1U}) {
        const mesh::Triangle wanted = test::quad_grid(1).triangles[half];
        while (source.mesh->triangles[smallest[half]] != wanted) ++smallest[half];
      }
      // Twice, so that the instances tie as well.
      SceneSpec twice = placed(source);
      twice.instances.push_back({});
      const Subject subject(std::move(twice));
      row.blocks(row.rays(8) * 10 / std::size_t(copies > 10 ? 200 : 10), [&](test::Random& random,
                                                                             std::size_t count) {
        std::vector<Shot> shots;
        for (std::size_t i = 0; i < count; ++i) {
          const double x = double(random.below(65)) / 64.0, y = double(random.below(65)) / 64.0;
          const bool diagonal = x + y == 1.0;
          const std::uint32_t winner =
              diagonal ? std::min(smallest[0], smallest[1]) : smallest[half_of(x, y)];
          shots.push_back({{{x, y, 3.0}, {0.0, 0.0, -2.0}}, {}, Expectation::hit({0, winner}, 1.5)});
        }
        // Exact mode decides every tie in integers.
        const auto all = std::span(kPrecisions).first(copies > 1000 ? 2 : kPrecisions.size());
        (void)subject.ask(row, shots, all);
        // After a refit and after a rebuild too.
        const auto& data = subject.spec().meshes[0].mesh->positions;
        for (const auto mode : {scene::UpdateMode::kRefit, scene::UpdateMode::kRebuild}) {
          const auto updated =
              scene::apply_update(subject.scene(), {scene::ReplaceVertices{0, data, {}, mode}});
          ASSERT_TRUE(updated.ok());
          for (const Shot& shot : shots) {
            const SurfaceHit hit = scene::intersect(*updated->scene, shot.ray);
            if (hit.instance_id != 0 || hit.primitive_id != shot.expected.primitive.primitive_id)
              row.fail(subject.spec(), shot, "after an update " + describe(hit));
          }
        }
      });
    }
  }
}

// Two squares a few floats apart, one above the other: the nearer one wins, seen from either side.
TEST(Stability, RC14_NearTies) {
  Row row(14, 10000);
  for (const int ulps : {0, 1, 2, 10, 1000}) {
    const float low = 1.F, high = 1.F + float(ulps) * 0x1p-23F;
    TriangleMesh mesh = test::translated(test::quad_grid(1), {0.F, 0.F, low});
    const TriangleMesh upper = test::translated(test::quad_grid(1), {0.F, 0.F, high});
    mesh.positions.insert(mesh.positions.end(), upper.positions.begin(), upper.positions.end());
    for (const auto& [a, b, c] : upper.triangles) mesh.triangles.push_back({a + 4, b + 4, c + 4});
    Subject subject(placed(given(mesh)));
    row.blocks(row.rays(10), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      while (shots.size() < count) {
        const bool above = random.below(2) == 0;
        const Vec3d origin(random.uniform(-1, 2), random.uniform(-1, 2), above ? 3.0 : -1.0);
        const Vec3d target(random.uniform(0.05, 0.95), random.uniform(0.05, 0.95), above ? high : low);
        if (std::abs(target.x + target.y - 1.0) < 0.01) continue;
        const std::uint32_t winner = (above && ulps > 0 ? 2U : 0U) + half_of(target.x, target.y);
        const Vec3d direction = (target - origin) * std::exp2(double(random.below(9)) - 4.0);
        shots.push_back({{origin, direction}, {}, Expectation::hit({0, winner})});
      }
      subject.shoot(row, shots);
    });
    // The same through instances that differ by a few doubles: beyond what robust tells apart, but not by
    // more than rounding.
    SceneSpec spec;
    spec.meshes = {generated("quad_grid 1 1")};
    const double gap = double(ulps) * 0x1p-52;
    spec.instances = {{0, {Mat3d(1.0), {0, 0, 1.0}}}, {0, {Mat3d(1.0), {0, 0, 1.0 + gap}}}};
    Subject instances(std::move(spec));
    row.blocks(row.rays(10), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      while (shots.size() < count) {
        const double x = double(1 + random.below(62)) / 64.0, y = double(1 + random.below(62)) / 64.0;
        const bool above = random.below(2) == 0;
        if (x + y == 1.0) continue;
        const Ray ray{{x, y, above ? 2.0 : 0.0}, {0.0, 0.0, above ? -1.0 : 1.0}};
        const std::uint32_t winner = above && ulps > 0 ? 1 : 0;
        shots.push_back(
            {ray, {}, Expectation::hit({winner, half_of(x, y)}, above ? 1.0 - gap : 1.0, gap + 0x1p-51)});
      }
      instances.shoot(row, shots);
    });
  }
}

}  // namespace
}  // namespace gridcast::stability
