#pragma once
// Scenes and rays on which `exact` mode is compared with the exact reference.

#include <algorithm>
#include <string>
#include <vector>

#include "core/scene/scene_data.h"
#include "tests/support/hostile.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::property {

using test::Random;

/// Identity, a rotation with shear, mirrored, far away, 1e-12 or 1e12 in scale, or squeezed along an axis.
inline Affine exact_placement(Random& random) {
  Affine affine;
  const std::uint32_t kind = random.below(10);
  if (kind > 1)
    for (int c = 0; c < 3; ++c) affine.linear[c] += random.in_box(0.7);
  if (kind == 1 || kind == 4) affine.translation = random.in_box(kind == 1 ? 10.0 : 1e6);
  if (kind == 3) affine.linear[0] = -affine.linear[0];
  if (kind == 5) affine.linear *= 1e-12;
  if (kind == 6) affine.linear *= 1e12;
  if (kind == 7) affine.linear[random.below(3)] *= 1e-9;
  if (kind == 8) affine.linear = {{1, 0, 0}, {0, random.below(2) == 0 ? 0x1p-40 : 0x1p-120, 0}, {0, 0, 1}};
  if (kind == 9) {  // flattened in the world: the inverse is as bad as that
    const int row = int(random.below(3));
    const double flat = std::exp2(-double(4 + random.below(30)));
    for (int c = 0; c < 3; ++c) affine.linear[c][row] *= flat;
  }
  return affine;
}

/// Small whole numbers: ties, in-plane rays and triangles without area come up by themselves.
inline mesh::TriangleMesh whole_numbers(Random& random) {
  mesh::TriangleMesh mesh;
  for (int i = 0; i < 15; ++i)
    mesh.positions.emplace_back(float(random.below(4)), float(random.below(4)), float(random.below(3)));
  for (int i = 0; i < 14; ++i)
    mesh.triangles.push_back({random.below(15), random.below(15), random.below(15)});
  return mesh;
}

inline mesh::TriangleMesh exact_mesh(Random& random) {
  const std::uint64_t seed = random.bits();
  switch (random.below(7)) {
    case 0:
      return test::soup(40, seed, 1.5F);
    case 1:
      return test::slivers(40, seed, 1e6F);
    case 2:
      return test::jittered_icosphere(1, seed);
    case 3:
      return test::needle_fan(40);
    case 4:
      return test::translated(test::soup(40, seed, 1.5F), {1e4F, -3e3F, 1e5F});
    case 5: {
      mesh::TriangleMesh tiny = whole_numbers(random);
      for (Vec3f& p : tiny.positions) p *= 1e-40F;
      return tiny;
    }
    default:
      return whole_numbers(random);
  }
}

/// One mesh in one to four places, some of them the same and some an ulp apart.
inline scene::SceneData exact_scene(Random& random) {
  scene::SceneData data;
  data.meshes.push_back(test::share(exact_mesh(random)));
  data.deformations.resize(1);
  const std::uint32_t count = 1 + random.below(2);
  for (std::uint32_t i = 0; i < count; ++i) data.instances.push_back({{}, exact_placement(random), 0});
  const Affine first = data.instances[0].world_from_object;
  if (random.below(3) == 0) data.instances.push_back({{}, first, 0});
  if (random.below(3) == 0) {
    data.instances.push_back({{}, first, 0});
    Vec3d& at = data.instances.back().world_from_object.translation;
    for (int axis = 0; axis < 3; ++axis) at[axis] = std::nextafter(at[axis], random.uniform(-1e9, 1e9));
  }
  return data;
}

/// At a corner, an edge or the inside of some triangle, along an axis, grazing, or anywhere; some of them
/// with a range that begins or ends near the triangle.
inline Ray exact_ray(Random& random, const scene::SceneData& data) {
  const auto& instance = data.instances[random.below(std::uint32_t(data.instances.size()))];
  const mesh::TriangleMesh& mesh = *data.meshes[0];
  const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangles.size())));
  const std::uint32_t kind = random.below(8);
  double u = random.uniform(), v = random.uniform(0.0, 1.0 - u);
  if (kind == 0) u = v = 0.0;
  if (kind == 1) u = 0.5, v = random.below(2) == 0 ? 0.0 : 0.5;
  const Vec3d p = (1.0 - u - v) * Vec3d(corners[0]) + u * Vec3d(corners[1]) + v * Vec3d(corners[2]);
  const Affine& placed = instance.world_from_object;
  const Vec3d target = placed.point(p);
  const double mesh_size = std::max(double(max_abs(corners[0])), double(max_abs(corners[1])));
  const double size = std::max(max_abs(placed.vector(Vec3d(1, 2, 3) * mesh_size)), 0x1p-190);
  Ray ray;
  ray.origin = target + random.in_box(3.0) * size;
  ray.direction = target - ray.origin;
  if (kind == 2) {  // axis-parallel, through the target
    const int axis = int(random.below(3));
    ray.origin = target, ray.direction = Vec3d(0.0);
    ray.origin[axis] -= 5.0 * size, ray.direction[axis] = size;
  }
  if (kind == 3)  // in the plane, or nearly
    ray.direction = placed.vector(Vec3d(corners[1]) - Vec3d(corners[0])) +
                    (random.below(2) == 0 ? 0.0 : 1e-12 * size) * random.direction();
  if (kind == 4) ray.origin = Vec3d(float(random.below(4)), float(random.below(4)), float(random.below(4)));
  if (kind == 6) ray.origin = target - ray.direction * std::exp2(double(random.below(45)));
  if (kind == 6) ray.direction = target - ray.origin;
  if (kind == 5) ray.direction *= std::exp2(double(random.below(80)) - 40.0);
  if (random.below(4) == 0) ray.tnear = random.below(2) == 0 ? -1.0 : 1.0;
  if (random.below(4) == 0) ray.tfar = random.below(2) == 0 ? 1.0 : 5.0;
  return ray;
}

}  // namespace gridcast::property
