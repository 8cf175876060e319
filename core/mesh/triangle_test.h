#pragma once
// The two triangle tests. Everything that reports a hit goes through intersect_triangle, so every
// structure gives the same bits.

#include <algorithm>

#include "core/math/exact.h"
#include "core/math/hit.h"
#include "core/mesh/object_ray.h"

namespace gridcast::mesh {

struct TriangleHit {
  double t, u, v;
};

/// A triangle with its coordinates in the order of the ray's axes: kx, ky, kz.
struct AxesTriangle {
  Vec3f p0, p1, p2;

  AxesTriangle(const Vec3f& first, const Vec3f& second, const Vec3f& third)
      : p0(first), p1(second), p2(third) {}
  AxesTriangle(const ObjectRay& ray, const Vec3f& first, const Vec3f& second, const Vec3f& third)
      : p0(in_axes(ray, first)), p1(in_axes(ray, second)), p2(in_axes(ray, third)) {}

 private:
  static Vec3f in_axes(const ObjectRay& ray, const Vec3f& p) {
    return {component(p, ray.kx), component(p, ray.ky), component(p, ray.kz)};
  }
};

namespace detail {

/// Edge functions: twice the areas that the ray cuts off, u opposite p0, v opposite p1, w opposite p2.
struct Sides {
  double u, v, w;
  [[nodiscard]] double lowest() const { return std::min(std::min(u, v), w); }
  [[nodiscard]] double highest() const { return std::max(std::max(u, v), w); }
  [[nodiscard]] double smallest() const { return std::min(std::min(std::abs(u), std::abs(v)), std::abs(w)); }
};

/// p - origin, sheared so that the ray runs along +z through (0, 0); z is not scaled.
/// A function of ray and vertex alone: neighbours see the same point, bit for bit.
inline Vec3d shear(const ObjectRay& ray, const Vec3f& p) {
  const double z = double(p.z) - ray.axes_origin.z;
  return {(double(p.x) - ray.axes_origin.x) - ray.shear_x * z,
          (double(p.y) - ray.axes_origin.y) - ray.shear_y * z, z};
}

/// Accurate for the ray and the triangle as given; the scale differs from that of the sheared sides by
/// direction_z.
[[nodiscard]] Sides exact_sides(const ObjectRay& ray, const AxesTriangle& triangle);

}  // namespace detail

/// Whether the object-space ray, exactly as given, meets the closed triangle: decided without error, so
/// neighbours leave no gap at edges or vertices, and a triangle without area or one that the ray runs
/// along is not hit. "Watertight Ray/Triangle Intersection", S. Woop, 2013, gives the form; unlike the paper
/// we shear in double, bound the rounding of every sign, and evaluate the undecided ones exactly. (u, v) and
/// t are those of a ray moved sideways by a few 2^-52 of the distance. The range [tnear, tfar] is not looked
/// at here.
///
/// Rounding of an edge function. With unit roundoff r = 2^-53 and D = ray.distance >= |p - o| per axis, a
/// sheared coordinate (two subtractions, a product, a shear of at most 1 off by 2 r) is off by at most 7 r D
/// < e = 2^-50 D. The products then add at most 4 r m^2, with m the largest sheared coordinate, m <= 2 D.
/// Together
///   |error| <= 4 e m + 2 e^2 + 4 r m^2 < 8 e (m + e),
/// and with m <= 2 D that is below 2^-45 D^2 = ray.side_error.
///
/// Inlined by force: the kernels compile it with FMA instructions, which give the same bits as std::fma in a
/// tenth of the time.
[[gnu::always_inline]] inline bool intersect_triangle_robust(const ObjectRay& ray,
                                                             const AxesTriangle& triangle, TriangleHit& hit) {
  const Vec3d a = detail::shear(ray, triangle.p0);
  const Vec3d b = detail::shear(ray, triangle.p1);
  const Vec3d c = detail::shear(ray, triangle.p2);
  const detail::Sides rough{c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x};
  if (rough.lowest() < -ray.side_error && rough.highest() > ray.side_error) return false;

  // Accurate for the sheared points as they are rounded.
  detail::Sides sides{difference_of_products(c.x, b.y, c.y, b.x), difference_of_products(a.x, c.y, a.y, c.x),
                      difference_of_products(b.x, a.y, b.y, a.x)};
  const double m = std::max(max_abs(Vec3d(a.x, b.x, c.x)), max_abs(Vec3d(a.y, b.y, c.y)));
  const double e = 0x1p-50 * ray.distance;
  if (sides.smallest() <= 8.0 * e * (m + e)) sides = detail::exact_sides(ray, triangle);
  if (sides.lowest() < 0.0 && sides.highest() > 0.0) return false;
  // All of one sign or 0: the sum is 0 only when all are, for a ray in the triangle's plane or a triangle
  // that it sees as a point. A triangle without area never comes here with sides of one sign.
  const double determinant = sides.u + sides.v + sides.w;
  if (determinant == 0.0) return false;

  // Depth relative to one vertex: exact when all three depths agree, accurate when they are close.
  const double z = a.z + (sides.v * (b.z - a.z) + sides.w * (c.z - a.z)) / determinant;
  const double nearest = std::min(std::min(a.z, b.z), c.z);
  const double farthest = std::max(std::max(a.z, b.z), c.z);
  hit = {std::min(std::max(z, nearest), farthest) / ray.direction_z, sides.v / determinant,
         sides.w / determinant};
  return true;
}
inline bool intersect_triangle_robust(const ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2,
                                      TriangleHit& hit) {
  return intersect_triangle_robust(ray, {ray, p0, p1, p2}, hit);
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
  const Vec3f from_p0 = ray.cull_origin - p0;
  const Vec3f q = glm::cross(from_p0, e1);
  const float u_size = glm::dot(from_p0, p);
  const float v_size = glm::dot(ray.cull_direction, q);
  // Most candidates end here, before the division: nothing that the comparisons below let pass.
  const float sign = std::copysign(1.F, determinant);
  if (std::min(sign * u_size, sign * v_size) < -0x1p-60F || sign * (u_size + v_size) > 1.0001F * size)
    return false;
  const float inverse = 1.F / determinant;
  const float u = u_size * inverse;
  const float v = v_size * inverse;
  if (!(u >= 0.F && u <= 1.F && v >= 0.F && u + v <= 1.F)) return false;
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

/// What becomes of a hit depends on this much of its ray.
struct RayEnds {
  double tnear;
  std::uint32_t instance_id;
  std::uint32_t excluded_primitive;
};

/// Whether a hit lies in [ray.tnear, tfar] and is not the excluded one. R: an ObjectRay or RayEnds.
template <class R>
inline bool in_range(const R& ray, const TriangleHit& hit, double tfar, std::uint32_t primitive_id) {
  return hit.t >= ray.tnear && hit.t <= tfar && primitive_id != ray.excluded_primitive;
}

/// Keeps `hit` in `best` when it is in range and closer by the tie rule. True when `best` was replaced.
template <class R>
inline bool keep_closer(const R& ray, const TriangleHit& hit, std::uint32_t primitive_id, Hit& best) {
  const Hit candidate{hit.t, hit.u, hit.v, ray.instance_id, primitive_id};
  if (!(hit.t >= ray.tnear) || !closer(candidate, best) || primitive_id == ray.excluded_primitive)
    return false;
  best = candidate;
  return true;
}

/// Tests one primitive. True when `best` was replaced.
template <Precision kPrecision>
inline bool intersect_primitive(const ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2,
                                std::uint32_t primitive_id, Hit& best) {
  TriangleHit hit;
  return intersect_triangle<kPrecision>(ray, p0, p1, p2, hit) && keep_closer(ray, hit, primitive_id, best);
}

}  // namespace gridcast::mesh
