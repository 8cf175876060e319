// Secondary rays: from hit points on hostile triangles, and between walls a few offsets apart.

#include "core/scene/spawn.h"

#include <algorithm>
#include <cmath>
#include <iostream>

#include <gtest/gtest.h>

#include "tests/stability/subject.h"
#include "tests/support/hostile.h"

namespace gridcast::stability {
namespace {

/// A triangle alone: whatever is hit is that which the ray left.
SceneSpec alone(const test::HostileTriangle& triangle) {
  mesh::TriangleMesh mesh;
  mesh.positions = {triangle.corners.begin(), triangle.corners.end()};
  mesh.triangles = {{0, 1, 2}};
  return placed(given(std::move(mesh)), triangle.transform.world_from_object());
}

/// Where a ray meets the triangle, or, for one that slips past, any point of it.
SurfaceHit some_hit(const scene::Scene& scene, const test::HostileTriangle& triangle, Precision precision,
                    test::Random& random) {
  SurfaceHit hit = scene::intersect(scene, test::hostile_ray(triangle, random), precision);
  if (hit.status == RayStatus::kHit) return hit;
  hit.status = RayStatus::kHit;
  hit.u = random.uniform();
  hit.v = random.uniform(0.0, 1.0 - hit.u);
  hit.instance_id = hit.mesh_id = hit.primitive_id = 0;
  return hit;
}

/// Into either half space: anywhere, along the plane at angles of 1e-1 to 1e-16, and exactly along an edge.
Vec3d some_direction(const test::HostileTriangle& triangle, test::Random& random) {
  const Vec3d along =
      triangle.transform.world_from_object().vector(Vec3d(triangle.corners[1]) - Vec3d(triangle.corners[0]));
  const Vec3d any = random.direction();
  const double length = std::exp2(random.uniform(-20.0, 20.0));
  const std::uint32_t kind = random.below(8);
  if (kind > 3 || !(max_abs(along) > 0.0)) return length * any;
  const Vec3d edge = along / max_abs(along);
  return length * (kind == 0 ? edge : edge + std::pow(10.0, random.uniform(-16.0, -1.0)) * any);
}

/// The longest side of pbrt's error box of the point with these weights, by the formulas of its Triangle and
/// Transform with the unit roundoff of its numbers. "Physically Based Rendering", M. Pharr, 2023, 6.8.
double pbrt_box(const test::HostileTriangle& triangle, const Vec3d& weights, double roundoff) {
  const auto gamma = [roundoff](int n) { return n * roundoff / (1.0 - n * roundoff); };
  Vec3d p(0.0), size(0.0);
  for (int i = 0; i < 3; ++i) {
    p += weights[i] * Vec3d(triangle.corners[std::size_t(i)]);
    size += glm::abs(weights[i] * Vec3d(triangle.corners[std::size_t(i)]));
  }
  const Affine& placed = triangle.transform.world_from_object();
  const Mat3d linear(glm::abs(placed.linear[0]), glm::abs(placed.linear[1]), glm::abs(placed.linear[2]));
  return max_abs((gamma(3) + 1.0) * (linear * (gamma(7) * size)) +
                 gamma(3) * (linear * glm::abs(p) + glm::abs(placed.translation)));
}

/// The largest of the boxes at the three corners.
double pbrt_box(const test::HostileTriangle& triangle, double roundoff) {
  return std::max({pbrt_box(triangle, {1.0, 0.0, 0.0}, roundoff),
                   pbrt_box(triangle, {0.0, 1.0, 0.0}, roundoff),
                   pbrt_box(triangle, {0.0, 0.0, 1.0}, roundoff)});
}

/// A plane with its normal in metres.
struct UnitPlane {
  explicit UnitPlane(const test::HostileTriangle& triangle)
      : plane(triangle.transform.world_from_object(), triangle.corners) {
    const Certified3& n = plane.normal();
    const Vec3d rough{n[0].high, n[1].high, n[2].high};
    length = max_abs(rough) * glm::length(rough / max_abs(rough));
    normal = rough / max_abs(rough) / glm::length(rough / max_abs(rough));
  }
  [[nodiscard]] double height(const Vec3d& p) const { return plane.height(p).high / length; }

  scene::WorldPlane plane;
  Vec3d normal;
  double length;
};

double share_of(std::vector<double>& all, double share) {
  std::sort(all.begin(), all.end());
  return all[std::size_t(share * double(all.size() - 1))];
}

/// pbrt computes in float; whoever computes its box in double gets a smaller one, which knows nothing of the
/// way back into object space: that is worth the condition of the transform.
struct Offsets {
  static constexpr std::size_t kKept = 1 << 20;
  double largest_of_float = 0.0, largest_of_double = 0.0;
  std::vector<double> of_double;  ///< of the first kKept rays

  void add(Row& row, const SceneSpec& spec, const test::HostileTriangle& triangle, const UnitPlane& plane,
           const Shot& shot) {
    const double offset = std::abs(plane.height(shot.ray.origin));
    const double condition = triangle.transform.condition();
    const double in_double = offset / (condition * pbrt_box(triangle, 0x1p-53));
    largest_of_double = std::max(largest_of_double, in_double);
    if (of_double.size() < kKept) of_double.push_back(in_double);
    // A transform that a float could not hold the inverse of has no box in float to compare with.
    if (!(condition < 0x1p24)) return;
    const double of_float = offset / pbrt_box(triangle, 0x1p-24);
    largest_of_float = std::max(largest_of_float, of_float);
    if (!(of_float <= 4.0)) row.fail(spec, shot, "the offset is more than 4 times pbrt's error box");
  }
};

/// Secondary rays of one triangle. They all miss it, in robust and in exact mode, and in fast mode where it
/// is excluded.
std::vector<Shot> leave(Row& row, const SceneSpec& spec, const scene::Scene& scene,
                        const test::HostileTriangle& triangle, std::size_t count, Offsets& offsets,
                        test::Random& random) {
  const UnitPlane plane(triangle);
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < count; ++i) {
    const SurfaceHit hit =
        some_hit(scene, triangle, i % 2 == 0 ? Precision::kRobust : Precision::kExact, random);
    const Ray ray = scene::SpawnPoint(scene, hit).ray(some_direction(triangle, random));
    shots.push_back({ray, {}, Expectation::miss()});
    offsets.add(row, spec, triangle, plane, shots.back());
    if (scene::occluded(scene, ray, Precision::kFast, {0, 0}) != RayStatus::kMiss)
      row.fail(spec, shots.back(), "fast mode hits the triangle that is excluded");
  }
  return shots;
}

TEST(Stability, RC35_SecondaryRays) {
  Row row(35, 40000);
  constexpr std::size_t kRaysPerTriangle = 256;
  constexpr std::size_t kAskedRays =
      40000;  // later ones are asked of one structure: building seven takes longer
  constexpr blas::StructureKind kInTurn[] = {blas::StructureKind::kBvh, blas::StructureKind::kWideBvh,
                                             blas::StructureKind::kCompactBvh, blas::StructureKind::kKdTree};
  Offsets offsets;
  std::size_t asked = 0;
  row.blocks(row.rays(), [&](test::Random& random, std::size_t total) {
    for (std::size_t done = 0; done < total; done += kRaysPerTriangle) {
      const std::size_t count = std::min(kRaysPerTriangle, total - done);
      const test::HostileTriangle triangle = test::hostile_triangle(random);
      const SceneSpec spec = alone(triangle);
      if ((asked += count) <= kAskedRays) {
        const Subject subject(spec);
        (void)subject.ask(row, leave(row, spec, subject.scene(), triangle, count, offsets, random));
        continue;
      }
      scene::SceneBuildOptions build;
      build.blas.kind = kInTurn[asked / kRaysPerTriangle % std::size(kInTurn)];
      const auto scene = scene::build_scene(scene_data(spec), build).value();
      for (const Shot& shot : leave(row, spec, *scene, triangle, count, offsets, random))
        for (const Precision precision : kPromising)
          if (scene::intersect(*scene, shot.ray, precision).status != RayStatus::kMiss)
            row.fail(spec, shot, std::string(to_string(precision)) + " hits the triangle that the ray left");
      row.count(count, 2 * count);
    }
  });
  std::cout << "offsets in units of pbrt's error box: at most " << offsets.largest_of_float
            << "; of the box in double, times the condition: median " << share_of(offsets.of_double, 0.5)
            << ", 99 % " << share_of(offsets.of_double, 0.99) << ", largest " << offsets.largest_of_double
            << '\n';
  // 36 r over a triangle twice as wide as its largest coordinate, along a diagonal normal, is 125 r of that
  // coordinate, the direction's share at most 42 r; pbrt's box has 10 r.
  EXPECT_LE(share_of(offsets.of_double, 0.999), 20.0);
  // At one triangle in ten thousand the rounding of the way back to object space undoes a move, and the moves
  // after it, twice as far each, overshoot: 134 was the most in 10^7 rays.
  EXPECT_LE(offsets.largest_of_double, 256.0);
}

/// Two copies of a triangle, the second one `gap` along the normal.
SceneSpec thin_wall(const test::HostileTriangle& triangle, const UnitPlane& plane, double gap) {
  SceneSpec spec = alone(triangle);
  Placement second = spec.instances[0];
  second.world_from_object.translation += gap * plane.normal;
  spec.instances.push_back(second);
  return spec;
}

/// The smallest altitude of the placed triangle.
double narrowest(const test::HostileTriangle& triangle, const UnitPlane& plane) {
  double longest = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d edge = Vec3d(triangle.corners[(i + 1) % 3]) - Vec3d(triangle.corners[i]);
    longest = std::max(longest, glm::length(triangle.transform.world_from_object().vector(edge)));
  }
  return plane.length / longest;
}

/// Whether rays to inside of the triangle are turned past its border on their way to object space, which in
/// robust mode may happen: about a sliver in a nearly singular placement.
bool may_be_turned_past(const test::HostileTriangle& triangle, const UnitPlane& plane) {
  const InstanceTransform& transform = triangle.transform;
  double reach = 0.0;
  for (const Vec3f& corner : triangle.corners)
    reach = std::max(reach, max_abs(transform.world_from_object().vector(Vec3d(corner))));
  // The aims are a fifth of an altitude away from the border; origin and way are turned by e reach each, in
  // the largest component.
  return 0.2 * narrowest(triangle, plane) < 2.0 * std::sqrt(3.0) * transform.round_trip_error() * reach;
}

TEST(Stability, RC35_ThinWallsDoNotLeak) {
  Row row(35, 8000);
  constexpr std::size_t kRaysPerWall = 64;
  constexpr Precision kExactAlone[] = {Precision::kExact};
  std::size_t walls = 0, slivers = 0;
  row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
    for (std::size_t done = 0; done < count;) {
      const test::HostileTriangle triangle = test::hostile_triangle(random);
      const UnitPlane plane(triangle);
      SurfaceHit middle;
      middle.instance_id = middle.mesh_id = middle.primitive_id = 0;
      const auto bare = scene::build_scene(scene_data(alone(triangle))).value();
      double offset = 0.0;
      for (int i = 0; i < 256; ++i) {
        middle.u = random.uniform(0.2, 0.4);
        middle.v = random.uniform(0.2, 0.4);
        const Vec3d towards = i % 2 == 0 ? plane.normal : -plane.normal;
        offset =
            std::max(offset, std::abs(plane.height(scene::SpawnPoint(*bare, middle).ray(towards).origin)));
      }
      // A translation is rounded to doubles: only a wall that got about the gap it should have is one.
      constexpr double kGaps[] = {4.0, 8.0, 100.0};
      const double gap = kGaps[random.below(3)] * offset;
      const Subject subject(thin_wall(triangle, plane, gap));
      const Vec3d moved = subject.spec().instances[1].world_from_object.translation -
                          triangle.transform.world_from_object().translation;
      const double real_gap = glm::dot(moved, plane.normal);
      if (!(real_gap > 3.0 * offset && glm::length(moved) < 2.0 * gap) ||
          !(narrowest(triangle, plane) > 100.0 * gap))
        continue;
      ++walls;
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < kRaysPerWall; ++i) {
        const std::uint32_t wall = random.below(2);
        const double side = random.below(2) == 0 ? 1.0 : -1.0;
        SurfaceHit hit = middle;
        hit.u = random.uniform(0.2, 0.4);
        hit.v = random.uniform(0.2, 0.4);
        hit.instance_id = wall;
        const Vec3d direction = side * plane.normal + random.in_box(0.3);
        const bool to_the_other = (wall == 0) == (side > 0.0);
        shots.push_back({scene::SpawnPoint(subject.scene(), hit).ray(direction),
                         {},
                         to_the_other ? Expectation::hit({1 - wall, 0}) : Expectation::miss()});
      }
      const bool exact_alone = may_be_turned_past(triangle, plane);
      if (exact_alone) ++slivers;
      (void)subject.ask(row, shots, exact_alone ? std::span<const Precision>(kExactAlone) : kPrecisions);
      done += kRaysPerWall;
    }
  });
  std::cout << walls << " walls, of which " << slivers << " are for exact mode alone\n";
  EXPECT_LT(slivers, walls / 4 + 2);
}

}  // namespace
}  // namespace gridcast::stability
