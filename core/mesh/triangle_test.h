#pragma once
// The two triangle tests. Everything that reports a hit goes through intersect_triangle, so every
// structure gives the same bits.

#include <algorithm>
#include <array>

#include "core/math/hit.h"
#include "core/mesh/object_ray.h"

namespace gridcast::mesh {

struct TriangleHit {
  double t, u, v;
};

namespace detail {

/// p - origin, sheared so that the ray runs along +z through (0, 0); z is not scaled.
/// A function of ray and vertex alone: neighbours see the same point, bit for bit.
inline Vec3d shear(const ObjectRay& ray, const Vec3f& p) {
  const double z = double(p[ray.kz]) - ray.origin[ray.kz];
  return {(double(p[ray.kx]) - ray.origin[ray.kx]) - ray.shear_x * z,
          (double(p[ray.ky]) - ray.origin[ray.ky]) - ray.shear_y * z, z};
}

/// The rest of the robust test, for the few triangles that the filter does not reject.
bool finish_robust(const ObjectRay& ray, const std::array<Vec3d, 3>& sheared, const Vec3f& p0,
                   const Vec3f& p1, const Vec3f& p2, TriangleHit& hit);

}  // namespace detail

/// Whether the object-space ray, exactly as given, meets the closed triangle: decided without error, so
/// neighbours leave no gap at edges or vertices, and a triangle without area or one that the ray runs
/// along is not hit. "Watertight Ray/Triangle Intersection", S. Woop, 2013, gives the form; unlike the paper
/// we shear in double, bound the rounding of every sign, and evaluate the undecided ones exactly. (u, v) and
/// t are those of a ray moved sideways by a few 2^-52 of the distance. The range [tnear, tfar] is not looked
/// at here.
inline bool intersect_triangle_robust(const ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2,
                                      TriangleHit& hit) {
  const std::array<Vec3d, 3> sheared{detail::shear(ray, p0), detail::shear(ray, p1), detail::shear(ray, p2)};
  const auto& [a, b, c] = sheared;
  const double u = c.x * b.y - c.y * b.x;
  const double v = a.x * c.y - a.y * c.x;
  const double w = b.x * a.y - b.y * a.x;
  const double error = ray.side_error;
  if (std::min({u, v, w}) < -error && std::max({u, v, w}) > error) return false;
  return detail::finish_robust(ray, sheared, p0, p1, p2, hit);
}

/// "Fast, Minimum Storage Ray/Triangle Intersection", T. Moeller, 1997, in float on the culling half of the
/// ray. Unlike the paper the answer is checked: when the point on the ray and the point on the triangle
/// differ by more than a quarter of the ray's pad (a sliver, a grazing ray), the robust test decides instead.
inline bool intersect_triangle_fast(const ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2,
                                    TriangleHit& hit) {
  const Vec3f e1 = p1 - p0;
  const Vec3f e2 = p2 - p0;
  const Vec3f p = glm::cross(ray.cull_direction, e2);
  const float determinant = glm::dot(e1, p);
  // Outside this range the products below leave the range of float.
  const float size = std::abs(determinant);
  if (!(size > 0x1p-80F && size < 0x1p80F)) return intersect_triangle_robust(ray, p0, p1, p2, hit);
  const float inverse = 1.F / determinant;
  const Vec3f from_p0 = ray.cull_origin - p0;
  const float u = glm::dot(from_p0, p) * inverse;
  if (!(u >= 0.F && u <= 1.F)) return false;
  const Vec3f q = glm::cross(from_p0, e1);
  const float v = glm::dot(ray.cull_direction, q) * inverse;
  if (!(v >= 0.F && u + v <= 1.F)) return false;
  const float s = glm::dot(e2, q) * inverse;

  const Vec3f difference = (ray.cull_origin + s * ray.cull_direction) - (p0 + u * e1 + v * e2);
  if (!(max_abs(difference) <= 0.25F * ray.pad)) return intersect_triangle_robust(ray, p0, p1, p2, hit);
  hit = {(double(s) + ray.cull_shift) / ray.cull_scale, double(u), double(v)};
  return true;
}

template <Precision kPrecision>
inline bool intersect_triangle(const ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2,
                               TriangleHit& hit) {
  if constexpr (kPrecision == Precision::kRobust) {
    return intersect_triangle_robust(ray, p0, p1, p2, hit);
  } else {
    return intersect_triangle_fast(ray, p0, p1, p2, hit);
  }
}

/// Tests one primitive and keeps it in `best` when it is in range and closer by the tie rule.
/// True when `best` was replaced.
template <Precision kPrecision>
inline bool intersect_primitive(const ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2,
                                std::uint32_t primitive_id, Hit& best) {
  TriangleHit hit;
  if (!intersect_triangle<kPrecision>(ray, p0, p1, p2, hit)) return false;
  const Hit candidate{hit.t, hit.u, hit.v, ray.instance_id, primitive_id};
  if (!(hit.t >= ray.tnear) || !closer(candidate, best) || primitive_id == ray.excluded_primitive)
    return false;
  best = candidate;
  return true;
}

}  // namespace gridcast::mesh
