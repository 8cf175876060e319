#pragma once
// The triangle test of `exact` mode: double with a bound, and exact numbers where the bound cannot decide.

#include "core/math/hit.h"
#include "core/mesh/exact_ray.h"
#include "core/mesh/triangle_test.h"

namespace gridcast::mesh {

/// A hit of the exact problem, with its t known to lie within t_error of `t`.
struct ExactHit : TriangleHit {
  double t_error;
  /// Bits of the sides known to be 0, of u, v and w: the ray meets an edge, or a corner where two are.
  std::uint8_t zero_sides = 0;
  bool rough_weights = false;  ///< u and v are off by a few roundings more than those of others
};

namespace detail {

/// What exact arithmetic says about the triangle. Sums of error-free products decide where the object-space
/// ray is the image to the last bit: of the products of a ray along an axis most are 0, so that they are few.
/// Integers decide the rest.
[[nodiscard]] bool decide_exactly(const ObjectRay& ray, std::uint32_t primitive_id, ExactHit& hit);

}  // namespace detail

/// Whether the world ray, as given, meets the closed triangle of the instance with corners A p + T in real
/// arithmetic; a triangle without area or one that the ray runs along is not met. `ray` was prepared by
/// ExactRay. The range [tnear, tfar] is not looked at here.
///
/// As in intersect_triangle_robust the triangle is sheared, but the bound also covers how far the
/// object-space ray is from the exact one, (o*, d*). Let r = 2^-53, D = ray.distance, a = |o' - o*|, g = |d'
/// - d*| / |d'_z| <= 2^-6, and drift >= a + g D. The shears differ by at most 2 g / (1 - g), the true one is
/// at most 1.04, so a sheared corner is off by at most 7 r D + 2.04 (a + g D) < e = 2^-50 D + 2.25 drift, and
/// an edge function with largest coordinate m by 4 e m + 2 e^2 + 4 r m^2 <= 5 e m + 2 e^2 < f = 8 e (m + e),
/// plus what underflow costs. As m <= 2 D (1 + 4 r), that is below 16.5 e (D + e) = ray.side_error.
///
/// t, by weights of one sign and depths z along the ray. With Z the largest difference of two depths and
/// A = |u + v + w|, each weight is off by (f + 3 f weight) / (A - 3 f), so z by 5 f Z / (A - 3 f), the depth
/// of the first corner by a, and all roundings together by 29 r D (of z and its parts 22, of the division 3,
/// and the sum's). t = z / d_z adds the turn of d_z, 1.02 g (D + a). With A >= 2^16 f all that is below
///   12 f Z / (A |d_z|) + (1.125 drift + 2^-48 D) / |d_z|,  the second part being ExactRay::t_error.
[[gnu::always_inline]] inline bool intersect_triangle_exact(const ObjectRay& ray,
                                                            const AxesTriangle& triangle,
                                                            std::uint32_t primitive_id, ExactHit& hit) {
  const Vec3d a = detail::shear(ray, triangle.p0);
  const Vec3d b = detail::shear(ray, triangle.p1);
  const Vec3d c = detail::shear(ray, triangle.p2);
  const detail::Sides sides{c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x};
  const double lowest = sides.lowest(), highest = sides.highest();
  if (lowest < -ray.side_error && highest > ray.side_error) return false;

  const double m = std::max(max_abs(Vec3d(a.x, b.x, c.x)), max_abs(Vec3d(a.y, b.y, c.y)));
  const double e = ray.exact->corner_error;
  const double bound = 8.0 * e * (m + e) + 0x1p-1000;
  if (lowest < -bound && highest > bound) return false;
  const double determinant = sides.u + sides.v + sides.w;
  if (!((lowest > bound || highest < -bound) && std::abs(determinant) > 0x1p16 * bound))
    return detail::decide_exactly(ray, primitive_id, hit);

  const double inverse = 1.0 / determinant;
  const double inverse_z = 1.0 / ray.direction_z;
  const double to_b = b.z - a.z, to_c = c.z - a.z;
  hit.u = sides.v * inverse;
  hit.v = sides.w * inverse;
  hit.t = (a.z + (hit.u * to_b + hit.v * to_c)) * inverse_z;
  hit.zero_sides = 0;
  hit.rough_weights = false;
  hit.t_error = ray.exact->t_error +
                12.0 * bound * std::max(std::abs(to_b), std::abs(to_c)) * std::abs(inverse * inverse_z);
  return true;
}

/// The closest hit found so far, in the order of the exact problem.
struct ExactBest {
  Hit hit;       ///< t is near the exact one
  double lower;  ///< the exact t lies in [lower, upper]; `upper` starts as tfar
  double upper;
  const Affine* world_from_object = nullptr;  ///< of the hit's instance
  const TriangleMesh* mesh = nullptr;         ///< of the hit
  std::uint8_t zero_sides = 0;                ///< of the hit, as in ExactHit
  bool rough_weights = false;

  explicit ExactBest(double tfar = 0.0) : lower(tfar), upper(tfar) { hit.t = tfar; }

  /// Keeps the candidate when it lies in [tnear, tfar] and is closer by the tie rule. True when it was kept.
  bool keep_closer(const ObjectRay& ray, const ExactHit& candidate, std::uint32_t primitive_id);
  /// Sets u and v of a valid hit to what a bound or integers give, where that was put off.
  void finish_weights(const Ray& world);

 private:
  [[nodiscard]] bool closer_exactly(const ObjectRay& ray, const ExactHit& candidate,
                                    std::uint32_t primitive_id) const;
  [[nodiscard]] bool at_same_point(const ObjectRay& ray, const ExactHit& candidate,
                                   std::uint32_t primitive_id) const;
};

/// Whether a hit of the exact problem lies in [tnear, tfar] and is not the excluded one.
[[nodiscard]] bool in_range(const ObjectRay& ray, const ExactHit& hit, double tfar,
                            std::uint32_t primitive_id);

}  // namespace gridcast::mesh
