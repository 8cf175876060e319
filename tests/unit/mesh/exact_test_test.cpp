// The triangle test of exact mode and what becomes of its hits, where the answer is known or by rationals.

#include "core/mesh/exact_test.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "tests/support/rational.h"
#include "tests/support/squeezed.h"

namespace gridcast::mesh {
namespace {

using test::cross;
using test::dot;
using test::operator-;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Asks one triangle; false where it is not hit.
bool ask(const TriangleMesh& mesh, const InstanceTransform& transform, const Ray& ray,
         std::uint32_t primitive_id, ObjectRay& object, ExactRay& exact, ExactHit& hit) {
  if (!exact.prepare(object, ray, transform, mesh, mesh.bounds(), kInfinity)) return false;
  const auto corners = mesh.corners(primitive_id);
  return intersect_triangle_exact(object, AxesTriangle(object, corners[0], corners[1], corners[2]),
                                  primitive_id, hit);
}

/// The closest of the triangles, offered in this order.
std::uint32_t closest(const TriangleMesh& mesh, const Ray& ray, std::initializer_list<std::uint32_t> order) {
  const InstanceTransform nowhere;
  ExactBest best(kInfinity);
  for (const std::uint32_t id : order) {
    ObjectRay object;
    ExactRay exact;
    ExactHit hit;
    if (ask(mesh, nowhere, ray, id, object, exact, hit)) best.keep_closer(object, hit, id);
  }
  return best.hit.primitive_id;
}

void expect_closest(const TriangleMesh& mesh, const Ray& ray, std::uint32_t primitive_id) {
  EXPECT_EQ(closest(mesh, ray, {0, 1}), primitive_id);
  EXPECT_EQ(closest(mesh, ray, {1, 0}), primitive_id);
}

/// Down the z axis.
const Ray kDown{{0.0, 0.0, 1.0}, {0.0, 0.0, -1.0}};
constexpr float kHair = 0x1p-60F;  // no t in double tells it apart

TriangleMesh two_triangles(std::vector<Vec3f> positions) {
  TriangleMesh mesh;
  mesh.positions = std::move(positions);
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  return mesh;
}

TEST(ExactBest, triangles_that_share_the_corner_or_the_edge_on_the_ray_are_a_tie) {
  expect_closest(two_triangles({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {-1, 0, 3}, {0, -1, 5}}), kDown,
                 0);
  expect_closest(two_triangles({{-1, 0, 0}, {2, 0, 1}, {0, 1, 0}, {2, 0, 1}, {-1, 0, 0}, {0, -1, 7}}), kDown,
                 0);
}

TEST(ExactBest, a_corner_beside_the_other_is_closer_however_little) {
  expect_closest(two_triangles({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, kHair}, {-1, 0, 0}, {0, -1, 0}}),
                 kDown, 1);
}

TEST(ExactBest, edges_with_one_corner_in_common_are_not_the_same) {
  expect_closest(two_triangles({{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}, {1, 0, kHair}}),
                 kDown, 1);
}

TEST(ExactBest, a_corner_of_an_edge_on_the_ray_is_not_a_corner_on_the_ray) {
  // The first has the edge from (-1, 0, 0) to (1, 0, 0) on the ray, the second its corner (0, 0, hair).
  expect_closest(two_triangles({{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, kHair}, {-1, 0, 0}, {0, -1, 0}}),
                 kDown, 1);
}

/// One triangle, and a ray at it.
struct Shot {
  TriangleMesh mesh;
  InstanceTransform transform;
  Ray ray;
};

/// Squeezed along a line of the world, and asked from beside it in its own space.
Shot squeezed_shot(test::Random& random) {
  Shot shot;
  for (int i = 0; i < 3; ++i) shot.mesh.positions.emplace_back(random.in_box(1.0));
  shot.mesh.triangles = {{0, 1, 2}};
  Mat3d linear(1.0), turn(1.0);
  for (int c = 0; c < 3; ++c) {
    linear[c] += random.in_box(0.4);
    turn[c] += random.in_box(0.4);
  }
  const double by = std::exp2(-random.uniform(0.0, 30.0));
  shot.transform = InstanceTransform({turn * Mat3d(1, 0, 0, 0, 1, 0, 0, 0, by) * linear, random.in_box(3.0)});
  const auto corners = shot.mesh.corners(0);
  const double u = random.uniform(), v = random.below(2) == 0 ? 0.0 : random.uniform(0.0, 1.0 - u);
  const Vec3d target = (1.0 - u - v) * Vec3d(corners[0]) + u * Vec3d(corners[1]) + v * Vec3d(corners[2]);
  const Affine& placed = shot.transform.world_from_object();
  shot.ray.origin = placed.point(target + random.in_box(2.0));
  shot.ray.direction = placed.point(target) - shot.ray.origin;
  return shot;
}

/// At a corner, or through the middle of a triangle around it, where the image of the ray is off by 2^-20.
Shot shot_in_plane(test::Random& random) {
  const test::SqueezedPlane plane(random);
  Shot shot;
  const int x = int(random.below(3));
  const Vec3f corner(float(x), 0.F, float(random.below(3)));
  const Vec3f first(random.in_box(1.0)), second(random.in_box(1.0));
  const Vec3f opposite = random.below(2) == 0 ? Vec3f(0.F) : -(first + second);
  shot.mesh.positions = {corner + opposite, corner + first, corner + second};
  shot.mesh.triangles = {{0, 1, 2}};
  shot.transform = InstanceTransform(plane.world_from_object());
  shot.ray = plane.ray_to(1 + int(3 * random.below(3)), x, double(corner.z));
  return shot;
}

/// The same at a triangle across the ray, whose depth alone counts.
Shot shot_across_plane(test::Random& random) {
  // Less than where integers decide.
  const test::SqueezedPlane plane(random, 74.0);
  Shot shot;
  shot.mesh.positions = {{-3.F, 1.F, -4.F}, {-3.F, 1.F, 4.F}, {4.F, 1.F, float(random.uniform(-1.0, 1.0))}};
  shot.mesh.triangles = {{0, 1, 2}};
  shot.transform = InstanceTransform(plane.world_from_object());
  shot.ray = plane.ray_across(1 + int(3 * random.below(2)));
  return shot;
}

bool is_hit(const Shot& one) {
  const Affine& placed = one.transform.world_from_object();
  const auto corners = one.mesh.corners(0);
  const test::Rational3 o = test::rational(one.ray.origin), d = test::rational(one.ray.direction);
  std::array<test::Rational3, 3> p;
  for (std::size_t i = 0; i < 3; ++i) p[i] = test::placed(placed, corners[i]) - o;
  const test::Rational sides[] = {dot(d, cross(p[2], p[1])), dot(d, cross(p[0], p[2])),
                                  dot(d, cross(p[1], p[0]))};
  const auto& [u, v, w] = sides;
  return u + v + w != 0 && ((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0));
}

template <class MakeShot>
void expect_as_rationals(const MakeShot& make_shot, std::uint64_t seed) {
  test::Random random(seed);
  std::size_t hits = 0;
  for (int i = 0; i < 3000; ++i) {
    const Shot one = make_shot(random);
    if (!one.transform.active() || !is_valid(one.ray)) continue;
    ObjectRay object;
    ExactRay exact;
    ExactHit hit;
    const bool got = ask(one.mesh, one.transform, one.ray, 0, object, exact, hit);
    ASSERT_EQ(got, is_hit(one)) << "ray " << i;
    if (!got) continue;
    ++hits;
    const test::RationalPlane plane(one.transform.world_from_object(), one.mesh.corners(0));
    const test::Rational off = abs(test::Rational(hit.t) - plane.t_of(one.ray));
    ASSERT_LE(off, test::Rational(hit.t_error)) << "ray " << i;
  }
  EXPECT_GT(hits, 1000U);
}

TEST(IntersectTriangleExact, decides_as_rationals_and_t_is_within_its_error) {
  expect_as_rationals(squeezed_shot, test::seed_or(5203));
}

TEST(IntersectTriangleExact, does_so_where_the_image_of_the_ray_has_few_digits) {
  expect_as_rationals(shot_in_plane, test::seed_or(5205));
  expect_as_rationals(shot_across_plane, test::seed_or(5206));
}

}  // namespace
}  // namespace gridcast::mesh
