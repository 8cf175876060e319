#pragma once
// One ray and one triangle of an instance, in real arithmetic.

#include <array>
#include <optional>

#include "core/math/affine.h"
#include "core/math/ray.h"
#include "core/measure/exact/dyadic.h"

namespace gridcast::measure::exact {

/// Where the ray's line meets a triangle. p = (1-u-v) p0 + u p1 + v p2, u and v rounded to the nearest.
struct TriangleHit {
  Ratio t;
  double u = 0.0;
  double v = 0.0;
};

/// The world triangle has the corners A p + T exactly, A and T being `world_from_object`. A hit lies in the
/// closed triangle and in [tnear, tfar], closed at both ends. A triangle of zero area and a ray in the
/// triangle's plane give none. Everything is finite but tnear and tfar, which may be infinite.
///
/// With x_i = corner i - origin and W_ij = direction . (x_i x x_j), the line meets the triangle if and only
/// if W_01, W_12 and W_20 are all >= 0 or all <= 0 and not all 0: their sum is direction . normal, which is 0
/// for an in-plane ray and for a triangle without area, and then all of one sign means all 0. t is x_0 . (x_1
/// x x_2) over that sum, and u, v are W_20 and W_01 over it (volumes of tetrahedra).
[[nodiscard]] std::optional<TriangleHit> intersect(const Ray& ray, const Affine& world_from_object,
                                                   const std::array<Vec3f, 3>& corners);

}  // namespace gridcast::measure::exact
