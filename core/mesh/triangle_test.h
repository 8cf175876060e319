#pragma once
// The two triangle tests. Everything that reports a hit goes through intersect_triangle, so every
// structure gives the same bits.

#include "core/math/hit.h"
#include "core/mesh/object_ray.h"

namespace gridcast::mesh {

struct TriangleHit {
  double t, u, v;
};

namespace detail {

/// a*b - c*d within 1.5 ulp, so its sign is exact and it is 0 only when the true value is.
/// "Further analysis of Kahan's algorithm for the accurate computation of 2x2 determinants",
/// C.-P. Jeannerod, 2013.
inline double difference_of_products(double a, double b, double c, double d) {
  const double cd = c * d;
  const double error = std::fma(-c, d, cd);
  return std::fma(a, b, -cd) + error;
}

/// Whether the ray lies in the triangle's plane or the triangle has no area: the exact value of
/// (p1-p0)x(p2-p0) . direction is 0. Called only when the projected area is within rounding of 0.
bool is_edge_on(const Vec3d& direction, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2);

/// The rest of the robust test, for the few triangles that pass the sign test: weights of 2x2
/// determinants without cancellation, and t from the interpolated depth.
bool finish_robust(const ObjectRay& ray, const Vec3d sheared[3], const Vec3f& p0, const Vec3f& p1,
                   const Vec3f& p2, TriangleHit& hit);

/// p - origin, sheared so that the ray runs along +z through (0, 0); z is not scaled.
/// A function of ray and vertex alone: neighbours see the same point, bit for bit.
inline Vec3d shear(const ObjectRay& ray, const Vec3f& p) {
  const double z = double(p[ray.kz]) - ray.origin[ray.kz];
  return {(double(p[ray.kx]) - ray.origin[ray.kx]) - ray.shear_x * z,
          (double(p[ray.ky]) - ray.origin[ray.ky]) - ray.shear_y * z, z};
}

}  // namespace detail

/// Watertight test, "Watertight Ray/Triangle Intersection", S. Woop, 2013, in double instead of float:
/// the shear decides which side of each edge the ray passes, with exact signs, so that triangles
/// sharing an edge or a vertex leave no gap. Unlike the paper, equal products are decided by an error-free
/// product instead of a wider type, and the weights come from the same product, so the hit is the exact
/// one of a ray moved sideways by a few 2^-52 of the distance.
/// The range [tnear, tfar] is not looked at here.
inline bool intersect_triangle_robust(const ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2,
                                      TriangleHit& hit) {
  const Vec3d sheared[3] = {detail::shear(ray, p0), detail::shear(ray, p1), detail::shear(ray, p2)};
  const auto& [a, b, c] = sheared;
  // The sign of a rounded difference of rounded products is right unless the products are equal,
  // because rounding is monotone; equal ones are left to finish_robust.
  const double u0 = c.x * b.y, u1 = c.y * b.x;
  const double v0 = a.x * c.y, v1 = a.y * c.x;
  const double w0 = b.x * a.y, w1 = b.y * a.x;
  const bool negative = u0 < u1 || v0 < v1 || w0 < w1;
  const bool positive = u0 > u1 || v0 > v1 || w0 > w1;
  if (negative && positive) return false;
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
