#include "core/scene/trace_exact.h"

#include <limits>

#include "core/scene/exact_t.h"

namespace gridcast::scene {
namespace {

/// A ray in one instance after another.
struct ExactQuery {
  const Scene& scene;
  const Ray& ray;
  const QueryFilter& filter;
  mesh::ObjectRay object_ray;
  mesh::ExactRay exact_ray;

  /// The structure to ask with `object_ray`, or null when nothing of the instance lies at tnear to `far`, or
  /// the ray does not see it.
  const blas::Blas* enter(std::uint32_t instance_id, double far) {
    const Instance instance = scene.instance(instance_id);
    if (!instance.seen_by(filter.mask)) return nullptr;
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    if (!exact_ray.prepare(object_ray, ray, instance.transform, blas.mesh(), blas.bounds(), far))
      return nullptr;
    object_ray.instance_id = instance_id;
    const PrimitiveRef& excluded = filter.excluded;
    object_ray.excluded_primitive = excluded.instance_id == instance_id ? excluded.primitive_id : kInvalidId;
    return &blas;
  }
};

}  // namespace

void closest_hit_exact(const Scene& scene, const Ray& ray, const QueryFilter& filter, Hit& best) {
  ExactQuery query{scene, ray, filter, {}, {}};
  mesh::ExactBest found(best.t);
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    if (const blas::Blas* blas = query.enter(id, found.upper)) blas->intersect_exact(query.object_ray, found);
    return found.upper;
  });
  finish_exact(ray, found, best);
}

void finish_exact(const Ray& ray, mesh::ExactBest& found, Hit& best) {
  if (!found.hit.valid()) return;
  found.finish_weights(ray);
  best = found.hit;
  best.t = exact_t(ray, *found.world_from_object, found.mesh->corners(best.primitive_id), best);
}

bool any_hit_exact(const Scene& scene, const Ray& ray, const QueryFilter& filter) {
  ExactQuery query{scene, ray, filter, {}, {}};
  bool hit = false;
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    const blas::Blas* blas = query.enter(id, ray.tfar);
    hit = blas != nullptr && blas->occluded_exact(query.object_ray, ray.tfar);
    return hit ? -std::numeric_limits<double>::infinity() : ray.tfar;
  });
  return hit;
}

}  // namespace gridcast::scene
