#include "core/scene/hit_error.h"

#include <limits>

#include "core/scene/world_plane.h"

namespace gridcast::scene {

double t_error(const Scene& scene, const Ray& ray, const SurfaceHit& hit) {
  const Affine& placed = scene.instance(hit.instance_id).transform.world_from_object();
  const WorldPlane plane(placed, scene.blas(hit.mesh_id).mesh().corners(hit.primitive_id));
  const double residual = plane.height(ray, hit.t).greatest_size();
  const double slope = plane.along(ray.direction).least_size();
  // Rounded up; the smallest double covers a quotient that underflows.
  const double bound = residual / slope * (1.0 + 0x1p-51) + std::numeric_limits<double>::denorm_min();
  return slope > 0.0 && bound >= 0.0 ? bound : std::numeric_limits<double>::infinity();
}

}  // namespace gridcast::scene
