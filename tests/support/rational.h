#pragma once
// Fractions without rounding, for what a test has to know exactly.

#include <array>

#include <gmpxx.h>

#include "core/math/affine.h"
#include "core/math/ray.h"

namespace gridcast::test {

using Rational = mpq_class;
using Rational3 = std::array<Rational, 3>;

inline Rational3 rational(const Vec3d& v) {
  return {Rational(v.x), Rational(v.y), Rational(v.z)};
}
inline Rational3 operator-(const Rational3& a, const Rational3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Rational dot(const Rational3& a, const Rational3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Rational3 cross(const Rational3& a, const Rational3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// A p + T.
inline Rational3 placed(const Affine& affine, const Vec3f& p) {
  Rational3 sum = rational(affine.translation);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      sum[std::size_t(row)] += Rational(affine.linear[column][row]) * Rational(p[column]);
  return sum;
}

/// The plane of a placed triangle: its normal, of any length, and one of its points.
struct RationalPlane {
  Rational3 normal, point;

  RationalPlane(const Affine& affine, const std::array<Vec3f, 3>& corners)
      : point(placed(affine, corners[0])) {
    normal = cross(placed(affine, corners[1]) - point, placed(affine, corners[2]) - point);
  }
  [[nodiscard]] Rational height(const Rational3& p) const { return dot(normal, p - point); }
  [[nodiscard]] Rational slope(const Ray& ray) const { return dot(normal, rational(ray.direction)); }
  /// Where the ray's line meets the plane; slope(ray) is not 0.
  [[nodiscard]] Rational t_of(const Ray& ray) const { return -height(rational(ray.origin)) / slope(ray); }
};

}  // namespace gridcast::test
