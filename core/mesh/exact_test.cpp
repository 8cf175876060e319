#include "core/mesh/exact_test.h"

#include <bit>
#include <limits>

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

std::uint8_t zero_bits(bool u, bool v, bool w) {
  return std::uint8_t(int(u) | int(v) << 1 | int(w) << 2);
}

/// Whether exact_sides is exact for the ray: its products must not underflow. Corners are multiples of
/// 2^-149, origins and directions then of 2^-252, products of three of 2^-756. They are below 2^420
/// (is_close).
bool sums_are_exact(const ObjectRay& ray) {
  constexpr double kLeast = 0x1p-200;
  bool in_range = ray.exact->is_image;
  for (int axis = 0; axis < 3; ++axis) {
    const double o = std::abs(ray.origin[axis]), d = std::abs(ray.direction[axis]);
    in_range = in_range && (o == 0.0 || o >= kLeast) && (d == 0.0 || d >= kLeast);
  }
  return in_range;
}

enum class Verdict : std::uint8_t { kMiss, kHit, kUndecided };

/// The decision of sums, and a hit on an edge or a corner; what else they find has u and v by integers.
///
/// Each side is known within 2 r of itself, r = 2^-53, and all are of one sign, so the sheared corners'
/// weights are off by 7 r of themselves and the depth by 14 r D for that, 29 r D for the rest (see
/// intersect_triangle_exact; there is no drift): below 2^-47 D together, twice ExactRay::t_error.
Verdict decide_by_sums(const ObjectRay& ray, std::uint32_t primitive_id, ExactHit& hit) {
  const auto corners = ray.exact->mesh->corners(primitive_id);
  const AxesTriangle triangle(ray, corners[0], corners[1], corners[2]);
  const detail::Sides sides = detail::exact_sides(ray, triangle);
  if (sides.lowest() < 0.0 && sides.highest() > 0.0) return Verdict::kMiss;
  const double determinant = sides.u + sides.v + sides.w;
  if (determinant == 0.0) return Verdict::kMiss;
  hit.zero_sides = zero_bits(sides.u == 0.0, sides.v == 0.0, sides.w == 0.0);
  if (hit.zero_sides == 0) return Verdict::kUndecided;
  const double a = detail::shear(ray, triangle.p0).z;
  const double to_b = detail::shear(ray, triangle.p1).z - a, to_c = detail::shear(ray, triangle.p2).z - a;
  hit.u = sides.v / determinant + 0.0;  // 0, never -0
  hit.v = sides.w / determinant + 0.0;
  hit.t = (a + (hit.u * to_b + hit.v * to_c)) / ray.direction_z;
  hit.t_error = 2.0 * ray.exact->t_error;
  hit.rough_weights = std::has_single_bit(hit.zero_sides);
  return Verdict::kHit;
}

}  // namespace

namespace detail {

bool decide_exactly(const ObjectRay& ray, std::uint32_t primitive_id, ExactHit& hit) {
  if (sums_are_exact(ray)) {
    const Verdict verdict = decide_by_sums(ray, primitive_id, hit);
    if (verdict != Verdict::kUndecided) return verdict == Verdict::kHit;
  }
  const ExactTriangle triangle = exact_triangle(ray, primitive_id);
  if (!triangle.hit()) return false;
  hit.t = triangle.t();
  hit.u = quotient(triangle.v, triangle.determinant);
  hit.v = quotient(triangle.w, triangle.determinant);
  hit.zero_sides = zero_bits(triangle.u.sign() == 0, triangle.v.sign() == 0, triangle.w.sign() == 0);
  hit.rough_weights = false;
  hit.t_error = std::abs(hit.t) * (2.0 * Dyadic::kQuotientError) + std::numeric_limits<double>::denorm_min();
  return true;
}

}  // namespace detail

bool in_range(const ObjectRay& ray, const ExactHit& hit, double tfar, std::uint32_t primitive_id) {
  return primitive_id != ray.excluded_primitive && after_near(ray, hit, primitive_id) &&
         before_far(ray, hit, tfar, primitive_id);
}

/// Whether both triangles have the edge or the corner in common that the ray meets: the corners whose weights
/// are not 0. A ray that meets a triangle is not parallel to its edges, so there is one such point and one t.
bool ExactBest::at_same_point(const ObjectRay& ray, const ExactHit& candidate,
                              std::uint32_t primitive_id) const {
  if (candidate.zero_sides == 0 || ray.instance_id != hit.instance_id ||
      std::popcount(candidate.zero_sides) != std::popcount(zero_sides))
    return false;
  const auto ours = mesh->corners(hit.primitive_id), theirs = mesh->corners(primitive_id);
  const auto is_ours = [&](const Vec3f& p) {
    return ((zero_sides & 1U) == 0 && p == ours[0]) || ((zero_sides & 2U) == 0 && p == ours[1]) ||
           ((zero_sides & 4U) == 0 && p == ours[2]);
  };
  for (std::size_t i = 0; i < 3; ++i)
    if ((candidate.zero_sides >> i & 1U) == 0 && !is_ours(theirs[i])) return false;
  return true;
}

bool ExactBest::closer_exactly(const ObjectRay& ray, const ExactHit& candidate,
                               std::uint32_t primitive_id) const {
  if (!at_same_point(ray, candidate, primitive_id)) {
    const ExactTriangle current(*ray.exact->world, *world_from_object, mesh->corners(hit.primitive_id));
    const int order = exact_triangle(ray, primitive_id).compare_t(current);
    if (order != 0) return order < 0;
  }
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
    if (!closer_exactly(ray, candidate, primitive_id)) return false;
    upper = std::min(upper, high);
  }
  lower = low;
  hit = {candidate.t, candidate.u, candidate.v, ray.instance_id, primitive_id};
  world_from_object = ray.exact->world_from_object;
  mesh = ray.exact->mesh;
  zero_sides = candidate.zero_sides;
  rough_weights = candidate.rough_weights;
  return true;
}

void ExactBest::finish_weights(const Ray& world) {
  if (!rough_weights) return;
  const ExactTriangle triangle(world, *world_from_object, mesh->corners(hit.primitive_id));
  hit.u = quotient(triangle.v, triangle.determinant);
  hit.v = quotient(triangle.w, triangle.determinant);
  rough_weights = false;
}

}  // namespace gridcast::mesh
