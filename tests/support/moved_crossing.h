#pragma once
// How a ray crosses a triangle once its origin is moved a little, in fractions: what mesh::line_crossing and
// mesh::is_ahead decide for a move smaller than any number, by another formula and with a real number.

#include "tests/support/rational.h"

namespace gridcast::test {

/// Smaller than what decides for coordinates that are integers of a few bits: the signs are those of
/// polynomials in the move, whose coefficients are integers below 2^20.
inline const Rational kMove{Rational(1) / Rational(mpz_class(1) << 40)};

struct MovedCrossing {
  int crossing = 0;     ///< +1 leaves, -1 enters, 0 passes by
  bool ahead = false;   ///< of the moved origin
  bool decided = true;  ///< false when the moved line still meets an edge
};

inline Rational3 moved(const Vec3d& origin) {
  Rational3 at = rational(origin);
  at[0] += kMove;
  at[1] += kMove * kMove;
  at[2] += kMove * kMove * kMove;
  return at;
}

/// By the plane's equation, then by the areas that the point where the line meets it cuts the triangle into.
inline MovedCrossing moved_crossing(const Vec3d& origin, const Vec3d& direction, const Vec3d& p0,
                                    const Vec3d& p1, const Vec3d& p2) {
  const Rational3 a = rational(p0), b = rational(p1), c = rational(p2), d = rational(direction);
  const Rational3 normal = cross(b - a, c - a);
  const Rational slope = dot(normal, d);
  if (slope == 0) return {};
  const Rational3 from = moved(origin);
  const Rational t = dot(normal, a - from) / slope;
  const Rational3 at{from[0] + t * d[0], from[1] + t * d[1], from[2] + t * d[2]};
  MovedCrossing found{slope > 0 ? 1 : -1, t > 0, t != 0};
  for (const Rational& area : {dot(normal, cross(b - at, c - at)), dot(normal, cross(c - at, a - at)),
                               dot(normal, cross(a - at, b - at))}) {
    if (area == 0) found.decided = false;
    if (area < 0) found.crossing = 0;
  }
  return found;
}

}  // namespace gridcast::test
