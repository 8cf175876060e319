#include "core/mesh/exact_test.h"

#include "core/mesh/exact_triangle.h"

namespace gridcast::mesh {
namespace {

ExactTriangle exact_triangle(const ObjectRay& ray, std::uint32_t primitive_id) {
  const ExactRay& exact = *ray.exact;
  const auto corners = exact.mesh->corners(primitive_id);
  if (exact.is_image) return {Ray{ray.origin, ray.direction}, corners};
  return {*exact.world, *exact.world_from_object, corners};
}

/// At least the true value of a + b, at most, by a rounding that may also be none.
double rounded_up(double a, double b) {
  const double sum = a + b;
  return sum + std::abs(sum) * 0x1p-52;
}
double rounded_down(double a, double b) {
  const double difference = a - b;
  return difference - std::abs(difference) * 0x1p-52;
}

bool after_near(const ObjectRay& ray, const ExactHit& hit, std::uint32_t primitive_id) {
  if (rounded_down(hit.t, hit.t_error) >= ray.tnear) return true;
  if (rounded_up(hit.t, hit.t_error) < ray.tnear) return false;
  return exact_triangle(ray, primitive_id).compare_t(ray.tnear) >= 0;
}

bool before_far(const ObjectRay& ray, const ExactHit& hit, double tfar, std::uint32_t primitive_id) {
  if (rounded_up(hit.t, hit.t_error) <= tfar) return true;
  if (rounded_down(hit.t, hit.t_error) > tfar) return false;
  return exact_triangle(ray, primitive_id).compare_t(tfar) <= 0;
}

}  // namespace

namespace detail {

bool decide_exactly(const ObjectRay& ray, std::uint32_t primitive_id, ExactHit& hit) {
  const ExactTriangle triangle = exact_triangle(ray, primitive_id);
  if (!triangle.hit()) return false;
  hit.t = triangle.t();
  hit.u = quotient(triangle.v, triangle.determinant);
  hit.v = quotient(triangle.w, triangle.determinant);
  hit.t_error = std::abs(hit.t) * (2.0 * Dyadic::kQuotientError) + std::numeric_limits<double>::denorm_min();
  return true;
}

}  // namespace detail

bool in_range(const ObjectRay& ray, const ExactHit& hit, double tfar, std::uint32_t primitive_id) {
  return primitive_id != ray.excluded_primitive && after_near(ray, hit, primitive_id) &&
         before_far(ray, hit, tfar, primitive_id);
}

bool ExactBest::closer_exactly(const ObjectRay& ray, std::uint32_t primitive_id) const {
  const ExactTriangle candidate = exact_triangle(ray, primitive_id);
  const ExactTriangle current(*ray.exact->world, *world_from_object, mesh->corners(hit.primitive_id));
  const int order = candidate.compare_t(current);
  if (order != 0) return order < 0;
  if (ray.instance_id != hit.instance_id) return ray.instance_id < hit.instance_id;
  return primitive_id < hit.primitive_id;
}

bool ExactBest::keep_closer(const ObjectRay& ray, const ExactHit& candidate, std::uint32_t primitive_id) {
  const double low = rounded_down(candidate.t, candidate.t_error);
  if (low > upper || primitive_id == ray.excluded_primitive) return false;
  if (hit.valid() && ray.instance_id == hit.instance_id && primitive_id == hit.primitive_id) return false;
  if (!after_near(ray, candidate, primitive_id)) return false;
  const double high = rounded_up(candidate.t, candidate.t_error);
  if (!hit.valid()) {
    if (!before_far(ray, candidate, upper, primitive_id)) return false;
    upper = std::min(upper, high);
  } else if (high < lower) {
    upper = high;
  } else {
    if (!closer_exactly(ray, primitive_id)) return false;
    upper = std::min(upper, high);
  }
  lower = low;
  hit = {candidate.t, candidate.u, candidate.v, ray.instance_id, primitive_id};
  world_from_object = ray.exact->world_from_object;
  mesh = ray.exact->mesh;
  return true;
}

void ExactBest::finish(const Ray& world) {
  hit.t = ExactTriangle(world, *world_from_object, mesh->corners(hit.primitive_id)).t();
}

}  // namespace gridcast::mesh
