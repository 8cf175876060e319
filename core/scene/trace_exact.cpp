#include "core/scene/trace_exact.h"

#include <cmath>
#include <limits>

#include "core/mesh/exact_test.h"
#include "core/mesh/exact_triangle.h"
#include "core/scene/world_plane.h"

namespace gridcast::scene {
namespace {

/// A ray in one instance after another.
struct ExactQuery {
  const Scene& scene;
  const Ray& ray;
  const PrimitiveRef& excluded;
  mesh::ObjectRay object_ray;
  mesh::ExactRay exact_ray;

  /// The structure to ask with `object_ray`, or null when nothing of the instance lies at tnear to `far`.
  const blas::Blas* enter(std::uint32_t instance_id, double far) {
    const Instance& instance = scene.instance(instance_id);
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    if (!exact_ray.prepare(object_ray, ray, instance.transform, blas.mesh(), blas.bounds(), far))
      return nullptr;
    object_ray.instance_id = instance_id;
    object_ray.excluded_primitive = excluded.instance_id == instance_id ? excluded.primitive_id : kInvalidId;
    return &blas;
  }
};

/// The exact t of a hit, within 2^-52 of itself, from one that is near it: t - t* = height(o + t d) / slope,
/// as in t_error. With 2^-50 relative error of the quotient and the bounds of its two sides, the corrected t
/// is off by less than
///   error / slope + 2^-49 |correction| + 2^-53 |t|.
/// Where that is too much to promise, integers divide.
double accurate_t(const Ray& ray, const Affine& placed, const std::array<Vec3f, 3>& corners, double t) {
  const WorldPlane plane(placed, corners);
  const Certified height = plane.height(ray, t);
  const Certified slope = plane.along(ray.direction);
  const double correction = height.high / slope.high;
  const double error = height.error / slope.least_size() + 0x1p-49 * std::abs(correction);
  const double corrected = t - correction;
  if (slope.error <= 0x1p-51 * slope.size() && error <= 0x1p-54 * std::abs(corrected)) return corrected;
  return mesh::ExactTriangle(ray, placed, corners).t();
}

}  // namespace

void closest_hit_exact(const Scene& scene, const Ray& ray, const PrimitiveRef& excluded, Hit& best) {
  ExactQuery query{scene, ray, excluded, {}, {}};
  mesh::ExactBest found(best.t);
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    if (const blas::Blas* blas = query.enter(id, found.upper)) blas->intersect_exact(query.object_ray, found);
    return found.upper;
  });
  if (!found.hit.valid()) return;
  best = found.hit;
  best.t = accurate_t(ray, *found.world_from_object, found.mesh->corners(best.primitive_id), best.t);
}

bool any_hit_exact(const Scene& scene, const Ray& ray, const PrimitiveRef& excluded) {
  ExactQuery query{scene, ray, excluded, {}, {}};
  bool hit = false;
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    const blas::Blas* blas = query.enter(id, ray.tfar);
    hit = blas != nullptr && blas->occluded_exact(query.object_ray, ray.tfar);
    return hit ? -std::numeric_limits<double>::infinity() : ray.tfar;
  });
  return hit;
}

}  // namespace gridcast::scene
