#include "core/mesh/crossing.h"

#include <cmath>

#include "core/math/exact.h"

namespace gridcast::mesh {
namespace {

int sign_of(double x) {
  return int(x > 0.0) - int(x < 0.0);
}

/// The sign of a . (b x c) where it is beyond the rounding, else 0. With the factors themselves rounded
/// differences of doubles the error stays below (7 + 56 r) r times the permanent, r = 2^-53 ("Adaptive
/// Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", J. R. Shewchuk, 1997); 8 r are
/// taken, and a floor for products that underflow.
int certain_sign(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const double value = glm::dot(a, glm::cross(b, c));
  const Vec3d x = glm::abs(a), y = glm::abs(b), z = glm::abs(c);
  const double permanent =
      x.x * (y.y * z.z + y.z * z.y) + x.y * (y.z * z.x + y.x * z.z) + x.z * (y.x * z.y + y.y * z.x);
  return std::abs(value) > 0x1p-50 * permanent + 0x1p-900 ? sign_of(value) : 0;
}

/// The sign of a component of (p - q) x d.
int sign_of_step(const Vec3d& d, const Vec3d& p, const Vec3d& q, int axis) {
  const int next = (axis + 1) % 3;
  const int last = (axis + 2) % 3;
  Expansion<8> sum;
  const auto add = [&](double a, double b) {
    const TwoTerm product = two_product(a, b);
    sum.add(product.low);
    sum.add(product.high);
  };
  add(p[next], d[last]);
  add(-q[next], d[last]);
  add(-p[last], d[next]);
  add(q[last], d[next]);
  return sign_of(sum.value());
}

/// The sign of the edge function of the moved origin; 0 only for an edge along the line.
int moved_side(const Vec3d& o, const Vec3d& d, const Vec3d& p, const Vec3d& q) {
  int sign = certain_sign(d, p - o, q - o);
  if (sign == 0) sign = sign_of(exact_side(d, o, p, q));
  for (int axis = 0; axis < 3 && sign == 0; ++axis) sign = sign_of_step(d, p, q, axis);
  return sign;
}

constexpr Vec3d kAxes[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};

/// The sign of (p0 - o) . n with n = (p1 - p0) x (p2 - p0).
int side_of_plane(const Vec3d& o, const Vec3d& p0, const Vec3d& p1, const Vec3d& p2) {
  const int sign = certain_sign(p0 - o, p1 - o, p2 - o);
  return sign != 0 ? sign : sign_of(exact_orientation(p0, p1, p2, o));
}

}  // namespace

int line_crossing(const Vec3d& origin, const Vec3d& direction, const Vec3d& p0, const Vec3d& p1,
                  const Vec3d& p2) {
  const int side = moved_side(origin, direction, p1, p2);
  if (side == 0 || moved_side(origin, direction, p2, p0) != side ||
      moved_side(origin, direction, p0, p1) != side)
    return 0;
  // The sides sum up to direction . normal.
  return side;
}

bool is_ahead(const Vec3d& origin, const Vec3d& p0, const Vec3d& p1, const Vec3d& p2, int crossing) {
  int side = side_of_plane(origin, p0, p1, p2);
  // Moving the origin changes (p0 - o) . n by -(e n.x + e^2 n.y + e^3 n.z).
  for (int axis = 0; axis < 3 && side == 0; ++axis) side = -sign_of(exact_side(kAxes[axis], p0, p1, p2));
  return side == crossing;
}

bool lies_on(const Vec3d& point, const Vec3d& p0, const Vec3d& p1, const Vec3d& p2) {
  const Vec3d lower = glm::min(glm::min(p0, p1), p2), upper = glm::max(glm::max(p0, p1), p2);
  if (!glm::all(glm::lessThanEqual(lower, point)) || !glm::all(glm::lessThanEqual(point, upper)))
    return false;
  if (side_of_plane(point, p0, p1, p2) != 0) return false;
  // In the plane: seen along an axis that the normal does not lie across, the point is in the triangle or
  // not.
  for (const Vec3d& axis : kAxes) {
    const double u = exact_side(axis, point, p1, p2);
    const double v = exact_side(axis, point, p2, p0);
    const double w = exact_side(axis, point, p0, p1);
    if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) return false;
    if (u != 0.0 || v != 0.0 || w != 0.0) return true;
  }
  return false;
}

}  // namespace gridcast::mesh
