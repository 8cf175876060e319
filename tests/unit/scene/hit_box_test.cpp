// Where hits of an instance can lie: boxes from the hull of a mesh.

#include "core/scene/hit_box.h"

#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

MeshHull hull_of(const mesh::TriangleMesh& mesh) {
  return MeshHull(mesh, mesh.bounds());
}

/// The direction itself with more or less of it along axes and diagonals, so that ties of components occur.
Vec3d awkward_direction(test::Random& random) {
  Vec3d n = random.direction();
  if (random.below(3) == 0) n = glm::round(n * 1.5);
  if (random.below(3) == 0) n[int(random.below(3))] = random.below(2) == 0 ? 0.0 : -0.0;
  return n * std::exp2(random.uniform(-40.0, 40.0));
}

TEST(MeshHull, nothing_of_the_mesh_lies_beyond_its_reach) {
  test::Random random(test::seed_or(61));
  const mesh::TriangleMesh meshes[] = {test::jittered_icosphere(3, 5), test::soup(200, 3),
                                       test::needle_fan(64), test::single_triangle(),
                                       test::translated(test::torus(12, 8), Vec3f(1e4F))};
  for (const mesh::TriangleMesh& mesh : meshes) {
    const MeshHull hull = hull_of(mesh);
    for (int i = 0; i < 300; ++i) {
      const Vec3d n = awkward_direction(random);
      const double length = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
      const double rounding = 0x1p-50 * length * double(hull.magnitude());
      for (const Vec3f& p : mesh.positions) {
        ASSERT_GE(hull.reach(n).forward + rounding, glm::dot(n, Vec3d(p)));
        ASSERT_GE(hull.reach(n).backward + rounding, -glm::dot(n, Vec3d(p)));
      }
    }
  }
}

TEST(MeshHull, says_the_same_by_signs_as_by_numbers) {
  const MeshHull hull = hull_of(test::soup(200, 3));
  const MeshHull::BySigns& by_signs = hull.by_signs();
  for (std::size_t signs = 0; signs < 8; ++signs) {
    const int x = (signs & 1U) != 0 ? -1 : 1, y = (signs & 2U) != 0 ? -3 : 3, z = (signs & 4U) != 0 ? -9 : 9;
    const int steps[3] = {x, y, z}, edges[3] = {y + z, x + z, x + y};
    EXPECT_EQ(by_signs.corners[signs], hull.along(x + y + z));
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(by_signs.faces[axis][signs], hull.along(steps[axis]));
      EXPECT_EQ(by_signs.edges[axis][signs], hull.along(edges[axis]));
    }
  }
}

TEST(MeshHull, is_within_an_eighth_of_a_sphere_where_its_box_is_up_to_three_quarters_off) {
  test::Random random(test::seed_or(62));
  const MeshHull hull = hull_of(test::icosphere(4));
  double largest = 0.0;
  for (int i = 0; i < 2000; ++i) largest = std::max(largest, hull.reach(random.direction()).forward);
  EXPECT_LT(largest, 1.13);
}

TEST(MeshHull, positions_that_no_triangle_uses_never_make_it_larger_than_the_box) {
  mesh::TriangleMesh mesh = test::icosphere(2);
  mesh.positions.push_back(Vec3f(50.F, -70.F, 1e9F));
  const Bounds3f box = mesh.bounds();
  const MeshHull hull(mesh, box);
  test::Random random(test::seed_or(63));
  for (int i = 0; i < 200; ++i) {
    const Vec3d n = random.direction();
    const double of_box = glm::dot(glm::max(n * Vec3d(box.lower), n * Vec3d(box.upper)), Vec3d(1.0));
    EXPECT_LE(hull.reach(n).forward, of_box * (1.0 + 0x1p-18));
  }
}

TEST(HitBox, holds_every_placed_vertex_and_is_empty_for_an_empty_mesh) {
  test::Random random(test::seed_or(64));
  const mesh::TriangleMesh mesh = test::soup(60, 9, 0.3F);
  const MeshHull hull = hull_of(mesh);
  for (int i = 0; i < 200; ++i) {
    Affine where = random_affine(random, 1e4, std::exp2(random.uniform(-20.0, 20.0)));
    const tlas::InstanceBox box = hit_box(InstanceTransform(where), hull);
    for (const Vec3f& p : mesh.positions) ASSERT_TRUE(box.bounds.contains(where.point(Vec3d(p))));
  }
  EXPECT_TRUE(hit_box(InstanceTransform(), hull_of({})).bounds.empty());
  EXPECT_TRUE(hit_box(InstanceTransform(Affine{Mat3d(0.0), Vec3d(0.0)}), hull).bounds.empty());
}

}  // namespace
}  // namespace gridcast::scene
