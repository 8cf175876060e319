// Sizes and transforms: tiny and huge, denormal, skewed, mirrored, nearly and exactly singular.

#include <gtest/gtest.h>
#include <xmmintrin.h>

#include "core/scene/update.h"
#include "tests/stability/exact_subject.h"
#include "tests/stability/subject.h"
#include "tests/support/closed_mesh.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::stability {
namespace {

/// From a point to somewhere on an instance's mesh.
Ray toward_instance(const SceneSpec& spec, std::uint32_t id, const Vec3d& origin, test::Random& random) {
  const auto& [mesh, where] = spec.instances[id];
  const auto& triangles = *spec.meshes[mesh].mesh;
  const auto corners = triangles.corners(random.below(std::uint32_t(triangles.triangle_count())));
  const double s = random.below(3) == 0 ? 0.0 : random.uniform(),
               r = random.below(2) == 0 ? 0.0 : random.uniform();
  const Vec3d on = Vec3d(corners[0]) +
                   s * ((1.0 - r) * Vec3d(corners[1] - corners[0]) + r * Vec3d(corners[2] - corners[0]));
  return {origin, where.point(on) - origin};
}

/// Of what toward_instance() aims, two thirds go to an edge or a corner, where rounding may choose among the
/// triangles that meet there; whether anything is hit it may choose at borders of soups and at silhouettes,
/// for `flipped` of the rays at most. The limits are about twice what was measured with several seeds.
void expect_usual(const ExactSubject::Seen& seen, double flipped) {
  const auto rays = double(seen.rays);
  constexpr double kFew = 3.0;
  EXPECT_LT(double(seen.undecided), 0.5 * rays + kFew);
  EXPECT_LT(double(seen.reordered), 0.03 * rays + kFew);
  EXPECT_LT(double(seen.flipped), flipped * rays + kFew);
  EXPECT_LT(seen.inverse, 7.0);
}

/// Squeezed along some line of the world, which the matrix shows in no row or column: from a point beside the
/// instance, digits cancel on the way to object space.
Affine flattened(const Affine& affine, double by, test::Random& random) {
  const Mat3d turn = scene::random_affine(random, 0.0, 1.0).linear;
  return {turn * Mat3d(1, 0, 0, 0, 1, 0, 0, 0, by) * affine.linear, affine.translation};
}

// 25 spheres in one another, from 1e-12 to 1e12 in size: from outside the largest is hit, from the middle the
// smallest.
TEST(Stability, RC16_TinyAndHugeInOneScene) {
  Row row(16, 4000);
  SceneSpec spec;
  spec.meshes = {generated("jittered_icosphere 2 16"), generated("torus 12 8")};
  for (int k = -12; k <= 12; ++k) spec.instances.push_back({0, {Mat3d(std::pow(10.0, k)), Vec3d(0.0)}});
  for (int k = -12; k <= 12; ++k)
    spec.instances.push_back({1, {Mat3d(std::pow(10.0, k)), Vec3d(std::pow(10.0, k + 1), 0.0, 0.0)}});
  ExactSubject subject(spec);
  row.blocks(row.rays(2), [&](test::Random& random, std::size_t count) {
    std::vector<Shot> shots;
    while (shots.size() < count) {
      const double from = std::pow(10.0, random.uniform(-13.0, 14.0));
      const Vec3d origin = random.below(4) == 0 ? Vec3d(0.0) : from * random.direction();
      const Ray ray = toward_instance(spec, random.below(50), origin, random);
      if (is_valid(ray)) shots.push_back({ray, {}, {}});
    }
    subject.shoot(row, std::move(shots));
  });
  subject.seen().tell("25 sizes");
  expect_usual(subject.seen(), 0.001);
  // Scaled by a power of two nothing changes but the unit.
  const Affine where = {Mat3d(0.75, 0.5, 0, -0.25, 1, 0, 0, 0.5, 2), Vec3d(3, -5, 0.25)};
  const Subject here(placed(spec.meshes[0], where));
  for (const int exponent : {-60, -30, 20, 60}) {
    const double s = std::ldexp(1.0, exponent);
    const Subject there(placed(spec.meshes[0], {s * where.linear, s * where.translation}));
    row.blocks(row.rays(8), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> near, far;
      for (std::size_t i = 0; i < count; ++i) {
        const Ray ray = toward_instance(here.spec(), 0, where.translation + random.in_box(6.0), random);
        near.push_back({ray, {}, {}});
        far.push_back({{s * ray.origin, s * ray.direction}, {}, {}});
      }
      Answers expected = here.ask(row, near);
      Answers got = there.ask(row, far);
      for (const Precision precision : kPromising) {
        const std::vector<SurfaceHit>&one = got.of(precision), &other = expected.of(precision);
        for (std::size_t i = 0; i < near.size(); ++i)
          if (!same_bits(one[i], other[i]))
            row.fail(there.spec(), far[i], "scaled " + describe(one[i]) + ", here " + describe(other[i]));
      }
    });
  }
}

/// While it lives this thread's denormals are zero, as Embree asks for.
class FlushToZero {
 public:
  FlushToZero() : before_(_mm_getcsr()) { _mm_setcsr(before_ | kFlushAndDenormalsAreZero); }
  ~FlushToZero() { _mm_setcsr(before_); }
  FlushToZero(const FlushToZero&) = delete;
  FlushToZero& operator=(const FlushToZero&) = delete;

 private:
  static constexpr unsigned kFlushAndDenormalsAreZero = 0x8040;
  unsigned before_;
};

// Denormal vertices, directions and t: closed meshes stay closed. A thread that flushes denormals gets the
// same answers where nothing is denormal, and no NaN elsewhere.
TEST(Stability, RC17_Denormals) {
  Row row(17, 6000);
  for (const char* scale : {"1", "1e-20", "1e-37", "1e-38", "1e-40"}) {
    const std::string s = std::string(" | scale ") + scale + ' ' + scale + ' ' + scale;
    const MeshSource source = generated("jittered_icosphere 2 17" + s);
    Subject subject(placed(source));
    const double size = std::stod(scale);
    row.blocks(row.rays(5), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      while (shots.size() < count) {
        // Directions of t = 1 and of t about 1e-38; kMinRayDirection is far below both.
        const Ray ray = toward_instance(subject.spec(), 0, 0.2 * size * random.in_box(1.0), random);
        const double stretch = random.below(2) == 0 ? 1.0 : 1e38;
        Shot shot{{ray.origin, stretch * ray.direction}, {}, Expectation::hit()};
        if (is_valid(shot.ray)) shots.push_back(shot);
      }
      subject.shoot(row, shots);
      const FlushToZero flush;
      for (const Shot& shot : shots) {
        const SurfaceHit hit = scene::intersect(subject.scene(), shot.ray);
        if (std::isnan(hit.t) || std::isnan(hit.u) || std::isnan(hit.v) || std::isnan(hit.normal.x))
          row.fail(subject.spec(), shot, "with denormals flushed " + describe(hit));
        // 1e-20: the products of the shear test are far from denormal in double.
        if (size >= 1e-20 && hit.status != RayStatus::kHit)
          row.fail(subject.spec(), shot, "with denormals flushed a leak");
      }
    });
  }
}

TEST(Stability, RC22_SkewedAndMirroredInstances) {
  Row row(22, 12000);
  ExactSubject::Seen seen;
  constexpr std::size_t kRaysPerScene = 120;
  row.blocks(row.rays() / kRaysPerScene, [&](test::Random& random, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) {
      SceneSpec spec;
      spec.meshes = {generated("jittered_icosphere 1 22"), generated("soup 40 9 0.5")};
      for (std::uint32_t i = 0; i < 6; ++i) {
        const Affine any = scene::random_affine(random, 3.0, std::exp2(random.uniform(-4.0, 1.0)));
        const double by = std::exp2(-random.uniform(0.0, 20.0));
        spec.instances.push_back({random.below(2), i % 3 == 0 ? flattened(any, by, random) : any});
      }
      ExactSubject subject(spec);
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < kRaysPerScene; ++i) {
        const std::uint32_t id = random.below(6);
        const Vec3d beside = spec.instances[id].world_from_object.point(random.in_box(3.0));
        const Vec3d origin = random.below(2) == 0 ? beside : random.in_box(8.0);
        Shot shot{toward_instance(spec, id, origin, random), {}, {}};
        // What it is aimed at lies at t = 1, but for rounding.
        if (i % 4 == 0) (random.below(2) == 0 ? shot.ray.tnear : shot.ray.tfar) = 1.0;
        shots.push_back(shot);
      }
      subject.judge(row, std::move(shots));
      seen += subject.seen();
    }
  });
  seen.tell("skewed and mirrored");
  expect_usual(seen, 0.13);
}

// Scales that differ by up to 1e16 along the axes of the mesh lose nothing (the condition that counts is that
// of |A||B|, which does not see them), along those of the world they lose as much; flattened to a plane, a
// line or a point, a file's instance is never hit and an update that asks for one is refused.
TEST(Stability, RC23_NearlyAndExactlySingularTransforms) {
  Row row(23, 2000);
  ExactSubject::Seen seen;
  const MeshSource source = generated("jittered_icosphere 2 23");
  struct Case {
    Affine where;
    bool singular;         // or out of range, beyond doubt
    bool is_usual = true;  // counts for how often hits may differ
  };
  std::vector<Case> cases;
  test::Random turns(23);
  for (int k = 0; k <= 16; ++k) {
    const Mat3d rotation = scene::random_affine(turns, 0.0, 1.0).linear;
    for (const Vec3d& flat :
         {Vec3d(1, 1, std::pow(10.0, -k)), Vec3d(1, std::pow(10.0, -k), std::pow(10.0, -k))})
      cases.push_back({{rotation * Mat3d(flat.x, 0, 0, 0, flat.y, 0, 0, 0, flat.z), Vec3d(1, 2, 3)}, false});
    if (k % 2 == 1 && k < 12)
      cases.push_back({flattened({rotation, Vec3d(1, 2, 3)}, std::pow(10.0, -k), turns), false});
  }
  // Far from singular for what looks at the condition alone; rays keep within the range of the exact test.
  for (const double side : {1e-30, 1e-42, 1e-50, 1e-200})
    cases.push_back({{Mat3d(side, 0, 0, 0, 1, 0, 0, 0, 1), Vec3d(1, 2, 3)}, side < 1e-43, false});
  for (const Mat3d& rank : {Mat3d(1, 0, 0, 0, 1, 0, 0, 0, 0), Mat3d(1, 0, 0, 0, 0, 0, 0, 0, 0), Mat3d(0.0),
                            Mat3d(1, 2, 3, 2, 4, 6, 1, 1, 1)})
    cases.push_back({{rank, Vec3d(1, 2, 3)}, true});
  const auto empty = scene::build_scene(scene_data({{source}, {}})).value();
  for (const auto& [where, singular, is_usual] : cases) {
    const bool active = InstanceTransform(where).active();
    EXPECT_FALSE(active && singular);
    const auto added = scene::apply_update(*empty, {scene::AddInstance{0, where, ""}});
    ASSERT_EQ(added.ok(), active);
    if (!active) {
      EXPECT_EQ(added.error().code, ErrorCode::kInvalidArgument);
      EXPECT_EQ(added.error().where, "/edits/0/world_from_object");
    }
    ExactSubject subject(placed(source, where));
    EXPECT_EQ(subject.subject().scene().data().warnings.size(), active ? 0U : 1U);
    row.blocks(row.rays(cases.size()), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        const Ray ray =
            toward_instance(subject.subject().spec(), 0, Vec3d(1, 2, 3) + random.in_box(3.0), random);
        if (is_valid(ray)) shots.push_back({ray, {}, {}});
      }
      subject.shoot(row, std::move(shots));
    });
    // Where nothing can be hit the reference knows of nothing.
    if (!active) {
      EXPECT_EQ(subject.seen().hits, 0U);
    }
    if (is_usual) seen += subject.seen();
  }
  seen.tell("nearly singular");
  expect_usual(seen, 0.08);
}

}  // namespace
}  // namespace gridcast::stability
