#pragma once
// One ray through both levels: what single rays and batches share.

#include <limits>

#include "core/mesh/object_ray.h"
#include "core/scene/query_filter.h"
#include "core/scene/scene.h"
#include "core/scene/trace_exact.h"

namespace gridcast::scene {

/// `ray` in the object space of an instance, ready for its tree. False when it misses the mesh's box.
inline bool prepare_for(mesh::ObjectRay& prepared, const InstanceTransform& transform, const blas::Blas& blas,
                        const Ray& ray, double far, std::uint32_t instance_id, const PrimitiveRef& excluded) {
  if (!prepared.prepare(ray, far, transform, blas.bounds())) return false;
  prepared.instance_id = instance_id;
  prepared.excluded_primitive = excluded.instance_id == instance_id ? excluded.primitive_id : kInvalidId;
  return true;
}

/// The same for an instance that the ray may not see: false then, too.
inline bool prepare_for(mesh::ObjectRay& prepared, const Instance& instance, const blas::Blas& blas,
                        const Ray& ray, double far, std::uint32_t instance_id, const QueryFilter& filter) {
  return instance.seen_by(filter.mask) &&
         prepare_for(prepared, instance.transform, blas, ray, far, instance_id, filter.excluded);
}

/// What `body` gives as a template for the precision.
template <class Body>
inline auto for_precision(Precision precision, const Body& body) {
  switch (precision) {
    case Precision::kFast:
      return body.template operator()<Precision::kFast>();
    case Precision::kRobust:
      return body.template operator()<Precision::kRobust>();
    case Precision::kExact:
      break;
  }
  return body.template operator()<Precision::kExact>();
}

/// The closest hit of a valid ray, starting from best.t = ray.tfar.
template <Precision kPrecision>
inline void closest_hit(const Scene& scene, const Ray& ray, const QueryFilter& filter, Hit& best) {
  if constexpr (kPrecision == Precision::kExact) {
    closest_hit_exact(scene, ray, filter, best);
  } else {
    mesh::ObjectRay object_ray;
    scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
      const Instance instance = scene.instance(id);
      const blas::Blas& blas = scene.blas(instance.mesh_id);
      if (prepare_for(object_ray, instance, blas, ray, best.t, id, filter))
        blas.template intersect<kPrecision>(object_ray, best);
      return best.t;
    });
  }
}

/// Whether a valid ray hits anything.
template <Precision kPrecision>
inline bool any_hit(const Scene& scene, const Ray& ray, const QueryFilter& filter) {
  if constexpr (kPrecision == Precision::kExact) {
    return any_hit_exact(scene, ray, filter);
  } else {
    bool hit = false;
    mesh::ObjectRay object_ray;
    scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
      const Instance instance = scene.instance(id);
      const blas::Blas& blas = scene.blas(instance.mesh_id);
      hit = prepare_for(object_ray, instance, blas, ray, ray.tfar, id, filter) &&
            blas.template occluded<kPrecision>(object_ray, ray.tfar);
      return hit ? -std::numeric_limits<double>::infinity() : ray.tfar;
    });
    return hit;
  }
}

/// A hit as the caller sees it, but for its status and normal.
inline void describe(const Scene& scene, const Hit& hit, SurfaceHit& surface) {
  surface.t = hit.t;
  surface.u = hit.u;
  surface.v = hit.v;
  surface.instance_id = hit.instance_id;
  surface.mesh_id = scene.instance(hit.instance_id).mesh_id;
  surface.primitive_id = hit.primitive_id;
}

}  // namespace gridcast::scene
