// Boxes never lose what is in them: slab tests, and the world boxes of instances.

#include <gtest/gtest.h>

#include "core/mesh/object_ray.h"
#include "core/tlas/world_ray.h"
#include "tests/stability/subject.h"
#include "tests/stability/wide_float.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::stability {
namespace {

/// A box of floats around `offset`, its extent along z `flat` of the others.
Bounds3f box_at(double offset, double flat, test::Random& random) {
  const Vec3d center = Vec3d(offset, -offset, offset) + random.in_box(2.0);
  const Vec3d half = Vec3d(random.uniform(0.01, 1.0), random.uniform(0.01, 1.0), 0.0) +
                     Vec3d(0.0, 0.0, flat * random.uniform(0.1, 1.0));
  return {Vec3f(center - half), Vec3f(center + half)};
}

/// At a corner, at an edge, or along an axis in a face; the direction in double.
Ray ray_at(const Bounds3d& box, test::Random& random) {
  Vec3d target;
  for (int axis = 0; axis < 3; ++axis)
    target[axis] = random.below(2) == 0 ? box.lower[axis] : box.upper[axis];
  if (random.below(2) == 0) {
    const auto along = int(random.below(3));
    target[along] = random.uniform(box.lower[along], box.upper[along]);
  }
  // Floats, so that differences have few bits.
  Ray ray{Vec3d(Vec3f(box.center() + random.in_box(4.0))), Vec3d(0.0)};
  if (random.below(4) == 0) {
    const auto along = int(random.below(3));
    for (int axis = 0; axis < 3; ++axis)
      if (axis != along) ray.origin[axis] = target[axis];
    ray.direction = Vec3d(random.below(2) == 0 ? 0.0 : -0.0);
    ray.direction[along] = target[along] > ray.origin[along] ? 1.0 : -1.0;
  } else {
    ray.direction = target - ray.origin;
  }
  if (random.below(4) == 0) ray.tfar = random.uniform(0.0, 1.5);
  return max_abs(ray.direction) > 0.0 ? ray : Ray{ray.origin, Vec3d(0, 0, 1), 0.0, ray.tfar};
}

TEST(Stability, RC03_SlabRounding) {
  Row row(3, 600000);
  std::size_t exact_hits = 0, false_accepts = 0;
  for (const double offset : {0.0, 1e3, 1e6}) {
    for (const double flat : {0.0, 1e-6, 1e-3, 0.1}) {
      row.blocks(row.rays(12), [&](test::Random& random, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) {
          const Bounds3f box = box_at(offset, flat, random);
          const Ray ray = ray_at(to_double(box), random);
          const bool exact = meets_exactly(ray, to_double(box));
          // The box of a tree's root, or one of many below it.
          Bounds3f root = box;
          if (i % 2 == 0) root.extend(box_at(offset, 0.5, random));
          mesh::ObjectRay prepared;
          float s_enter = 0.F;
          const bool mesh_level =
              prepared.prepare(ray, root) &&
              mesh::intersect_box(prepared, box.lower, box.upper, prepared.cull_far(ray.tfar), s_enter);
          const bool top_level =
              !tlas::intersect_alone(tlas::WorldRay(ray), {to_double(box), 0.F}, ray.tfar).empty();
          exact_hits += std::size_t(exact);
          false_accepts += std::size_t(!exact && mesh_level);
          if (exact && !mesh_level) row.fail("the float slab test of a mesh's tree rejects an exact hit");
          if (exact && !top_level) row.fail("the double slab test of the top level rejects an exact hit");
        }
        row.count(count, 2 * count);
      });
    }
  }
  EXPECT_GT(exact_hits, row.rays() / 10);
  std::cout << exact_hits << " exact hits; " << false_accepts << " boxes accepted that the ray misses\n";
}

TEST(Stability, RC24_WorldBoundsOfInstances) {
  Row row(24, 2000);
  const MeshSource sources[] = {generated("soup 60 9 0.3"), generated("jittered_icosphere 2 5"),
                                generated("soup 20 3 0.3 | translate 1e5 -1e5 3")};
  row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
    SceneSpec spec;
    for (const MeshSource& source : sources) spec.meshes.push_back(source);
    for (std::size_t i = 0; i < count; ++i) {
      const double spread = std::exp2(random.uniform(0.0, 40.0));
      spec.instances.push_back(
          {random.below(3), scene::random_affine(random, spread, std::exp2(random.uniform(-30.0, 30.0)))});
    }
    const auto built = scene::build_scene(scene_data(spec)).value();
    for (std::uint32_t id = 0; id < count; ++id) {
      const auto& [mesh, where] = spec.instances[id];
      const Bounds3d box = built->top_level().box(id).bounds;
      for (const Vec3f& p : spec.meshes[mesh].mesh->positions) {
        for (int axis = 0; axis < 3; ++axis) {
          WideFloat image = where.translation[axis];
          for (int c = 0; c < 3; ++c) image += WideFloat(where.linear[c][axis]) * WideFloat(p[c]);
          if (image < WideFloat(box.lower[axis]) || image > WideFloat(box.upper[axis]))
            row.fail("instance " + std::to_string(id) + ": a vertex lies outside of the world box");
        }
      }
    }
    row.count(count, count);
  });
}

}  // namespace
}  // namespace gridcast::stability
