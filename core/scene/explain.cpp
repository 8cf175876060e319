#include "core/scene/explain.h"

#include <new>

#include "core/mesh/exact_ray.h"
#include "core/scene/geometric_normal.h"
#include "core/scene/trace.h"
#include "core/scene/trace_one.h"

namespace gridcast::scene {
namespace {

enum class HitsBox : std::uint8_t { kNo, kYes };

/// What is told of an instance that the ray sees or not, and whose mesh's box it hits or not.
InstanceOutcome outcome_of(const Instance& instance, const QueryFilter& filter, HitsBox hits_box) {
  if (!instance.seen_by(filter.mask)) return InstanceOutcome::kMasked;
  return hits_box == HitsBox::kYes ? InstanceOutcome::kEntered : InstanceOutcome::kMeshMissed;
}

/// Tells of an instance that the top level leads to; whether to go on into its tree.
bool enter_instance(const Scene& scene, std::uint32_t id, std::optional<double> t_enter,
                    InstanceOutcome outcome, RayWay& way) {
  InstanceStep step{id, kInvalidId, outcome, t_enter, {}};
  const bool is_entered = outcome == InstanceOutcome::kEntered;
  if (is_entered) step.structure = to_string(scene.blas(scene.instance(id).mesh_id).stats().kind);
  return way.add(step) && is_entered;
}

/// closest_hit() for `fast` and `robust`, told step by step.
template <Precision kPrecision>
void walk(const Scene& scene, const Ray& ray, const QueryFilter& filter, Hit& best, RayWay& way) {
  mesh::ObjectRay object_ray;
  const auto visit = [&](std::uint32_t id, std::optional<double> t_enter) {
    const Instance instance = scene.instance(id);
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    const bool is_hit = prepare_for(object_ray, instance, blas, ray, best.t, id, filter);
    const auto outcome = outcome_of(instance, filter, is_hit ? HitsBox::kYes : HitsBox::kNo);
    if (enter_instance(scene, id, t_enter, outcome, way)) blas.explain<kPrecision>(object_ray, best, way);
    return best.t;
  };
  scene.top_level().explain(ray, ray.tfar, visit, way);
}

/// closest_hit_exact(), told step by step.
template <>
void walk<Precision::kExact>(const Scene& scene, const Ray& ray, const QueryFilter& filter, Hit& best,
                             RayWay& way) {
  mesh::ObjectRay object_ray;
  mesh::ExactRay exact_ray;
  mesh::ExactBest found(best.t);
  const auto visit = [&](std::uint32_t id, std::optional<double> t_enter) {
    const Instance instance = scene.instance(id);
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    const bool is_hit =
        instance.seen_by(filter.mask) &&
        exact_ray.prepare(object_ray, ray, instance.transform, blas.mesh(), blas.bounds(), found.upper);
    object_ray.instance_id = id;
    const PrimitiveRef& excluded = filter.excluded;
    object_ray.excluded_primitive = excluded.instance_id == id ? excluded.primitive_id : kInvalidId;
    const auto outcome = outcome_of(instance, filter, is_hit ? HitsBox::kYes : HitsBox::kNo);
    if (enter_instance(scene, id, t_enter, outcome, way))
      blas.explain<Precision::kExact>(object_ray, found, way);
    return found.upper;
  };
  scene.top_level().explain(ray, ray.tfar, visit, way);
  finish_exact(ray, found, best);
}

SurfaceHit surface_of(const Scene& scene, const Ray& ray, const Hit& best) {
  SurfaceHit surface;
  if (!best.valid()) return surface;
  surface.status = RayStatus::kHit;
  describe(scene, best, surface);
  surface.normal = geometric_normal(scene, best, ray);
  return surface;
}

Result<Explanation> explain_valid(const Scene& scene, const Ray& ray, const ExplainOptions& options) {
  RayWay way(options.max_steps, ray.tfar, options.stop);
  const QueryFilter filter{options.excluded, options.mask};
  Hit best{.t = ray.tfar};
  for_precision(options.precision,
                [&]<Precision kPrecision>() { walk<kPrecision>(scene, ray, filter, best, way); });
  if (way.is_stopped()) return Error{ErrorCode::kCancelled, "the explanation was cancelled", ""};
  Explanation told;
  told.is_truncated = way.is_truncated();
  told.counts = way.counts();
  told.hit = told.is_truncated ? intersect(scene, ray, options.precision, options.excluded, options.mask)
                               : surface_of(scene, ray, best);
  told.steps = std::move(way).take_steps();
  // The top level knows no meshes.
  for (WayStep& step : told.steps)
    if (auto* instance = std::get_if<InstanceStep>(&step))
      instance->mesh_id = scene.instance(instance->instance_id).mesh_id;
  return told;
}

}  // namespace

Result<Explanation> explain(const Scene& scene, const Ray& ray, const ExplainOptions& options) try {
  if (is_valid(ray)) return explain_valid(scene, ray, options);
  Explanation told;
  told.hit.status = RayStatus::kInvalid;
  return told;
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the steps", ""};
}

}  // namespace gridcast::scene
