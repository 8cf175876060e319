#include "core/mesh/object_ray.h"

#include <tuple>

#include <gtest/gtest.h>

#include "core/mesh/triangle_test.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::mesh {
namespace {

using test::Random;

/// Aims at a random point of a random triangle, from near, far and very far, along axes and off them.
Ray aimed_ray(Random& random, const TriangleMesh& mesh) {
  const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangle_count())));
  const double a = random.uniform(), b = random.uniform() * (1.0 - a);
  const Vec3d target = (1.0 - a - b) * Vec3d(corners[0]) + a * Vec3d(corners[1]) + b * Vec3d(corners[2]);
  const double size = double(mesh.bounds().magnitude());
  Vec3d direction = random.direction();
  for (int axis = 0; axis < 3; ++axis)
    if (random.below(3) == 0) direction[axis] = random.below(2) == 0 ? 0.0 : -0.0;
  if (max_abs(direction) == 0.0) direction.x = -1.0;
  const double distance = size * std::exp2(random.uniform(-4.0, 30.0));
  const double length = std::exp2(random.uniform(-40.0, 40.0));
  return {target - distance * direction, direction * length};
}

class ObjectRayOver : public testing::TestWithParam<const char*> {};

TriangleMesh named_mesh(const std::string& name) {
  if (name == "soup") return test::soup(300, 5);
  if (name == "slivers") return test::slivers(300, 6, 1e5F);
  if (name == "grid") return test::quad_grid(12, 3.F);
  if (name == "far") return test::translated(test::icosphere(2), Vec3f(1e6F, -2e6F, 5e5F));
  TriangleMesh mesh = test::icosphere(2);
  const float scale = name == "tiny" ? 1e-38F : name == "huge" ? 1e17F : 1.F;
  for (Vec3f& p : mesh.positions) p *= scale;
  return mesh;
}

template <Precision kPrecision>
void expect_hits_inside_padded_boxes(const TriangleMesh& mesh, std::uint64_t seed) {
  Random random(seed);
  const Bounds3f bounds = mesh.bounds();
  int hits = 0;
  for (int i = 0; i < 3000; ++i) {
    const Ray ray = aimed_ray(random, mesh);
    ObjectRay prepared;
    const bool meets = prepared.prepare(ray, bounds);
    if (!meets) {
      ASSERT_TRUE(prepared.prepare(ray, Bounds3f{Vec3f(-1e18F), Vec3f(1e18F)}));
    }
    for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
      const auto [p0, p1, p2] = mesh.corners(id);
      TriangleHit hit;
      if (!intersect_triangle<kPrecision>(prepared, p0, p1, p2, hit) || hit.t < ray.tnear) continue;
      ++hits;
      ASSERT_TRUE(meets) << "ray " << i << " was rejected although it hits triangle " << id;
      const Bounds3f box = mesh.triangle_bounds(id);
      float s_enter;
      ASSERT_TRUE(intersect_box(prepared, box.lower, box.upper, prepared.cull_far(hit.t), s_enter))
          << "ray " << i << " hits triangle " << id << " outside its box";
    }
  }
  EXPECT_GT(hits, 500);
}

TEST_P(ObjectRayOver, no_accepted_hit_is_culled_by_its_own_box) {
  const TriangleMesh mesh = named_mesh(GetParam());
  const std::uint64_t seed = test::seed_or(21);
  expect_hits_inside_padded_boxes<Precision::kRobust>(mesh, seed);
  expect_hits_inside_padded_boxes<Precision::kFast>(mesh, seed);
}

INSTANTIATE_TEST_SUITE_P(Meshes, ObjectRayOver,
                         testing::Values("sphere", "soup", "slivers", "grid", "far", "tiny", "huge"),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST(IntersectBox, an_outer_box_never_fails_nor_enters_later_than_one_inside_it) {
  Random random(test::seed_or(22));
  for (int i = 0; i < 200000; ++i) {
    Bounds3f outer, inner;
    for (int k = 0; k < 2; ++k) outer.extend(Vec3f(random.in_box(1.0)));
    for (int k = 0; k < 2; ++k) {
      const Vec3d w{random.uniform(), random.uniform(), random.uniform()};
      inner.extend(
          glm::clamp(Vec3f(glm::mix(Vec3d(outer.lower), Vec3d(outer.upper), w)), outer.lower, outer.upper));
    }
    ObjectRay ray;
    if (!ray.prepare({random.in_box(2.0), random.direction()}, outer)) continue;
    const float s_far = ray.cull_far(random.uniform(0.0, 4.0));
    float inner_enter, outer_enter;
    if (!intersect_box(ray, inner.lower, inner.upper, s_far, inner_enter)) continue;
    ASSERT_TRUE(intersect_box(ray, outer.lower, outer.upper, s_far, outer_enter));
    ASSERT_LE(outer_enter, inner_enter);
  }
}

TEST(ObjectRay, a_world_ray_and_an_instance_are_the_ray_in_object_space_bit_for_bit) {
  const TriangleMesh mesh = test::icosphere(2);
  Random random(test::seed_or(23));
  int met = 0;
  for (int i = 0; i < 20000; ++i) {
    Affine world_from_object;
    for (int axis = 0; axis < 3; ++axis) world_from_object.linear[axis] = random.in_box(2.0);
    world_from_object.translation = random.in_box(100.0);
    const InstanceTransform transform(world_from_object);
    if (!transform.active()) continue;
    const Ray object = aimed_ray(random, mesh);
    const Ray world{world_from_object.linear * object.origin + world_from_object.translation,
                    world_from_object.linear * object.direction,
                    i % 2 == 0 ? 0.0 : random.uniform(-1.0, 1.0)};
    const double far = i % 3 == 0 ? random.uniform(0.0, 4.0) : world.tfar;
    const Ray moved{transform.point_to_object(world.origin), transform.vector_to_object(world.direction),
                    world.tnear, far};
    ObjectRay at_once, in_two_steps;
    const bool meets = in_two_steps.prepare(moved, mesh.bounds());
    ASSERT_EQ(at_once.prepare(world, far, transform, mesh.bounds()), meets) << i;
    if (!meets) continue;
    ++met;
    const auto halves = [](const ObjectRay& r) {
      return std::tuple(r.origin, r.direction, r.tnear, r.kx, r.ky, r.kz, r.axes_origin, r.direction_z,
                        r.shear_x, r.shear_y, r.distance, r.side_error, r.cull_scale, r.cull_shift,
                        Vec3f(r.cull_origin), Vec3f(r.cull_direction), r.cull_axes_origin,
                        Vec3f(r.inverse_direction), Vec3f(r.near_offset), Vec3f(r.far_offset), r.pad);
    };
    ASSERT_EQ(halves(at_once), halves(in_two_steps)) << i;
  }
  EXPECT_GT(met, 5000);
}

TEST(ObjectRay, a_ray_that_clearly_misses_the_mesh_is_rejected_at_once) {
  const Bounds3f unit{Vec3f(0.F), Vec3f(1.F)};
  ObjectRay ray;
  EXPECT_FALSE(ray.prepare({{2.0, 0.5, -5.0}, {0.0, 0.0, 1.0}}, unit));
  EXPECT_FALSE(ray.prepare({{0.5, 0.5, -5.0}, {0.0, 0.0, -1.0}}, unit));
  EXPECT_FALSE(ray.prepare({{0.5, 0.5, -5.0}, {0.0, 0.0, 1.0}, 0.0, 4.0}, unit));
  EXPECT_TRUE(ray.prepare({{0.5, 0.5, -5.0}, {0.0, 0.0, 1.0}, 0.0, 5.0}, unit));
  EXPECT_TRUE(ray.prepare({{0.5, 0.5, -5.0}, {0.0, 0.0, 1.0}, 6.0}, unit));
  EXPECT_FALSE(ray.prepare({{0.5, 0.5, -5.0}, {0.0, 0.0, 1.0}, 7.0}, unit));
  EXPECT_FALSE(ray.prepare({{0.5, 0.5, 0.5}, {0.0, 0.0, 1.0}}, Bounds3f{}));
}

}  // namespace
}  // namespace gridcast::mesh
