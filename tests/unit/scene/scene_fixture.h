#pragma once
// Scenes and rays for the tests of core/scene.

#include <algorithm>
#include <map>
#include <string>

#include <glm/gtc/matrix_transform.hpp>
#include <gtest/gtest.h>

#include "core/mesh/triangle_test.h"
#include "core/scene/trace.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::scene {

/// Rotated, scaled per axis, sometimes mirrored and sheared.
inline Affine random_affine(test::Random& random, double spread, double size) {
  const Vec3d axis = random.direction();
  glm::dmat4 m = glm::rotate(glm::dmat4(1.0), random.uniform(0.0, 6.3), axis);
  Vec3d scale{random.uniform(0.3, 2.0), random.uniform(0.3, 2.0), random.uniform(0.3, 2.0)};
  if (random.below(3) == 0) scale.x = -scale.x;
  Mat3d shear(1.0);
  if (random.below(3) == 0) shear[1][0] = random.uniform(-1.0, 1.0);
  Mat3d linear = Mat3d(m) * shear;
  for (int c = 0; c < 3; ++c) linear[c] *= size * scale[c];
  return {linear, random.in_box(spread)};
}

inline SceneData meshes_only() {
  SceneData data;
  data.meshes = {test::share(test::jittered_icosphere(2, 5)), test::share(test::torus(12, 8)),
                 test::share(test::box({-1, -1, -1}, {1, 1, 1})), test::share(test::soup(60, 9, 0.3F))};
  data.deformations.resize(data.meshes.size());
  return data;
}

inline void place(SceneData& data, std::uint32_t mesh_id, const Affine& where) {
  data.instances.push_back({{}, where, mesh_id});
}

/// Scenes of `count` instances that a top level may get wrong.
inline std::map<std::string, SceneData> awkward_scenes(int count, test::Random& random) {
  std::map<std::string, SceneData> all;
  for (const char* name :
       {"cloud", "flat city", "stadium", "line", "giant", "coincident", "nested", "far off"})
    all[name] = meshes_only();
  const auto mesh = [&] { return random.below(4); };
  for (int i = 0; i < count; ++i) {
    place(all["cloud"], mesh(), random_affine(random, 10.0, 0.5));
    const Vec3d ground{random.uniform(-50, 50), 0.0, random.uniform(-50, 50)};
    place(all["flat city"], 2, {Mat3d(1.0), ground});
    place(all["stadium"], mesh(), random_affine(random, i % 50 == 0 ? 500.0 : 0.5, 0.05));
    place(all["line"], mesh(), {Mat3d(0.3), Vec3d(i, 0.0, 0.0)});
    place(all["giant"], mesh(), i == 0 ? Affine{Mat3d(100.0), Vec3d(0.0)} : random_affine(random, 90.0, 0.5));
    place(all["coincident"], 0, {Mat3d(1.0), Vec3d(0.5)});
    place(all["nested"], 2, {Mat3d(1.0 + 0.25 * i), Vec3d(0.0)});
    Affine far = random_affine(random, 5.0, 0.3);
    far.translation += Vec3d(1e6, -1e6, 3e5);
    place(all["far off"], mesh(), far);
  }
  return all;
}

inline std::shared_ptr<const Scene> built(SceneData data, const SceneBuildOptions& options = {}) {
  auto scene = build_scene(std::move(data), options);
  EXPECT_TRUE(scene.ok()) << (scene.ok() ? "" : scene.error().message);
  return *scene;
}

/// Aimed at instances, some along axes, some from far away, some segments.
inline Ray random_ray(const Scene& scene, test::Random& random) {
  const auto& instance = scene.instance(random.below(std::uint32_t(scene.instance_slots())));
  const Vec3d target = instance.transform.world_from_object().point(random.in_box(0.8));
  const double size = max_abs(scene.bounds().extent());
  const double away = random.below(3) == 0 ? 0.05 * size : (random.below(5) == 0 ? 3e4 * size : size);
  Ray ray{target + away * random.in_box(1.0), Vec3d(1, 0, 0)};
  ray.direction = target - ray.origin;
  if (random.below(5) == 0) {
    const int axis = int(random.below(3));
    ray.direction = Vec3d(0.0);
    ray.direction[axis] = random.below(2) == 0 ? -1.0 : 1.0;
    ray.origin[(axis + 1) % 3] = target[(axis + 1) % 3];
    ray.origin[(axis + 2) % 3] = target[(axis + 2) % 3];
  }
  if (random.below(6) == 0) ray.tfar = random.uniform(0.0, 1.0);
  if (random.below(6) == 0) ray.tnear = random.uniform(-1.0, 1.0);
  if (max_abs(ray.direction) == 0.0) ray.direction = Vec3d(0, 0, 1);
  return ray;
}

/// Every triangle of every instance, with no structure at all.
inline Hit brute_force(const Scene& scene, const Ray& ray, Precision precision) {
  Hit best{.t = ray.tfar};
  for (std::uint32_t id = 0; id < scene.instance_slots(); ++id) {
    const auto instance = scene.find_instance(id);
    if (!instance || !instance->transform.active()) continue;
    const auto& mesh = scene.blas(instance->mesh_id).mesh();
    mesh::ObjectRay object;
    const Ray local{instance->transform.point_to_object(ray.origin),
                    instance->transform.vector_to_object(ray.direction), ray.tnear, best.t};
    if (!object.prepare(local, mesh.bounds())) continue;
    object.instance_id = id;
    for (std::uint32_t k = 0; k < mesh.triangle_count(); ++k) {
      const auto [p0, p1, p2] = mesh.corners(k);
      if (precision == Precision::kFast) {
        mesh::intersect_primitive<Precision::kFast>(object, p0, p1, p2, k, best);
      } else {
        mesh::intersect_primitive<Precision::kRobust>(object, p0, p1, p2, k, best);
      }
    }
  }
  return best;
}

inline bool same(const SurfaceHit& a, const SurfaceHit& b) {
  return a.status == b.status && a.t == b.t && a.u == b.u && a.v == b.v && a.normal == b.normal &&
         a.instance_id == b.instance_id && a.mesh_id == b.mesh_id && a.primitive_id == b.primitive_id;
}

/// `count` instances of meshes_only(), anywhere and anyhow.
inline std::shared_ptr<const Scene> start_scene(test::Random& random, int count) {
  SceneData data = meshes_only();
  for (int i = 0; i < count; ++i) place(data, random.below(4), random_affine(random, 8.0, 0.5));
  return built(std::move(data));
}

}  // namespace gridcast::scene
