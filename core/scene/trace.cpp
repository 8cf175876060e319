#include "core/scene/trace.h"

#include <atomic>
#include <new>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/math/exact.h"
#include "core/mesh/object_ray.h"

namespace gridcast::scene {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Rays per task, and between two looks at the stop token.
constexpr std::size_t kRaysPerTask = 2048;

/// `ray` in the object space of an instance, ready for its tree. False when it misses the mesh's box.
bool prepare(mesh::ObjectRay& prepared, const InstanceTransform& transform, const blas::Blas& blas,
             const Ray& ray, double far, std::uint32_t instance_id, const PrimitiveRef& excluded) {
  const Ray object{transform.point_to_object(ray.origin), transform.vector_to_object(ray.direction),
                   ray.tnear, far};
  if (!prepared.prepare(object, blas.bounds())) return false;
  prepared.instance_id = instance_id;
  prepared.excluded_primitive = excluded.instance_id == instance_id ? excluded.primitive_id : kInvalidId;
  return true;
}

/// Unit world normal of the geometric kind, from the corners in double.
Vec3d geometric_normal(const Scene& scene, const Hit& hit, const Ray& ray) {
  const Instance& instance = scene.instance(hit.instance_id);
  const auto corners = scene.blas(instance.mesh_id).mesh().corners(hit.primitive_id);
  const Vec3d p0(corners[0]);
  const Vec3d a = Vec3d(corners[1]) - p0, b = Vec3d(corners[2]) - p0;
  const Vec3d normal{difference_of_products(a.y, b.z, a.z, b.y), difference_of_products(a.z, b.x, a.x, b.z),
                     difference_of_products(a.x, b.y, a.y, b.x)};
  // A sliver whose area is lost to rounding has no side: face the ray.
  if (!(max_abs(normal) > 0.0)) return -glm::normalize(ray.direction / max_abs(ray.direction));
  return instance.transform.normal_to_world(normal);
}

template <Precision kPrecision>
SurfaceHit intersect_one(const Scene& scene, const Ray& ray, const PrimitiveRef& excluded) {
  SurfaceHit surface;
  if (!is_valid(ray)) {
    surface.status = RayStatus::kInvalid;
    return surface;
  }
  Hit best{.t = ray.tfar};
  mesh::ObjectRay object_ray;
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    const Instance& instance = scene.instance(id);
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    if (prepare(object_ray, instance.transform, blas, ray, best.t, id, excluded))
      blas.template intersect<kPrecision>(object_ray, best);
    return best.t;
  });
  if (!best.valid()) return surface;
  surface.status = RayStatus::kHit;
  surface.t = best.t;
  surface.u = best.u;
  surface.v = best.v;
  surface.normal = geometric_normal(scene, best, ray);
  surface.instance_id = best.instance_id;
  surface.mesh_id = scene.instance(best.instance_id).mesh_id;
  surface.primitive_id = best.primitive_id;
  return surface;
}

template <Precision kPrecision>
RayStatus occluded_one(const Scene& scene, const Ray& ray, const PrimitiveRef& excluded) {
  if (!is_valid(ray)) return RayStatus::kInvalid;
  bool hit = false;
  mesh::ObjectRay object_ray;
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    const Instance& instance = scene.instance(id);
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    hit = prepare(object_ray, instance.transform, blas, ray, ray.tfar, id, excluded) &&
          blas.template occluded<kPrecision>(object_ray, ray.tfar);
    return hit ? -kInfinity : ray.tfar;
  });
  return hit ? RayStatus::kHit : RayStatus::kMiss;
}

/// Runs `trace_ray(i)` for every ray over all cores. False when stopped.
template <class TraceRay>
bool for_each_ray(std::size_t count, const TraceOptions& options, const TraceRay& trace_ray) {
  std::atomic<std::size_t> done = 0;
  const auto piece = [&](const tbb::blocked_range<std::size_t>& range) {
    if (options.stop.stop_requested()) return;
    for (std::size_t i = range.begin(); i < range.end(); ++i) trace_ray(i);
    const std::size_t now = done += range.size();
    if (options.progress) options.progress(double(now) / double(count));
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kRaysPerTask), piece,
                    tbb::simple_partitioner());
  return done == count;
}

PrimitiveRef excluded_of(const RayBatch& rays, std::size_t i) {
  return i < rays.excluded.size() ? rays.excluded[i] : PrimitiveRef{};
}

Error cancelled() {
  return {ErrorCode::kCancelled, "the trace was cancelled", ""};
}

Error out_of_memory() {
  return {ErrorCode::kLimitExceeded, "not enough memory for the answers", ""};
}

template <Precision kPrecision>
bool intersect_all(const Scene& scene, const RayBatch& rays, const TraceOptions& options, HitColumns& hits) {
  return for_each_ray(rays.size(), options, [&](std::size_t i) {
    hits.set(i, intersect_one<kPrecision>(scene, rays[i], excluded_of(rays, i)));
  });
}

template <Precision kPrecision>
bool occluded_all(const Scene& scene, const RayBatch& rays, const TraceOptions& options,
                  std::vector<RayStatus>& status) {
  return for_each_ray(rays.size(), options, [&](std::size_t i) {
    status[i] = occluded_one<kPrecision>(scene, rays[i], excluded_of(rays, i));
  });
}

}  // namespace

SurfaceHit intersect(const Scene& scene, const Ray& ray, Precision precision, PrimitiveRef excluded) {
  return precision == Precision::kFast ? intersect_one<Precision::kFast>(scene, ray, excluded)
                                       : intersect_one<Precision::kRobust>(scene, ray, excluded);
}

RayStatus occluded(const Scene& scene, const Ray& ray, Precision precision, PrimitiveRef excluded) {
  return precision == Precision::kFast ? occluded_one<Precision::kFast>(scene, ray, excluded)
                                       : occluded_one<Precision::kRobust>(scene, ray, excluded);
}

Result<HitColumns> intersect(const Scene& scene, const RayBatch& rays, const TraceOptions& options) try {
  HitColumns hits;
  hits.resize(rays.size(), options.fields);
  const bool whole = options.precision == Precision::kFast
                         ? intersect_all<Precision::kFast>(scene, rays, options, hits)
                         : intersect_all<Precision::kRobust>(scene, rays, options, hits);
  if (!whole) return cancelled();
  return hits;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

Result<std::vector<RayStatus>> occluded(const Scene& scene, const RayBatch& rays,
                                        const TraceOptions& options) try {
  std::vector<RayStatus> status(rays.size(), RayStatus::kMiss);
  const bool whole = options.precision == Precision::kFast
                         ? occluded_all<Precision::kFast>(scene, rays, options, status)
                         : occluded_all<Precision::kRobust>(scene, rays, options, status);
  if (!whole) return cancelled();
  return status;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

}  // namespace gridcast::scene
