#include "core/mesh/exact_triangle.h"

#include <cmath>

namespace gridcast::mesh {
namespace {

using Point = std::array<Dyadic, 3>;

/// A p + (T - o).
Point relative(const Affine& placed, const Vec3f& p, const Vec3d& origin) {
  Point out;
  for (int row = 0; row < 3; ++row) {
    Dyadic sum = Dyadic(placed.translation[row]) - Dyadic(origin[row]);
    for (int column = 0; column < 3; ++column)
      sum = sum + Dyadic(placed.linear[column][row]) * Dyadic(double(p[column]));
    out[std::size_t(row)] = sum;
  }
  return out;
}

Point relative(const Vec3f& p, const Vec3d& origin) {
  return {Dyadic(double(p.x)) - Dyadic(origin.x), Dyadic(double(p.y)) - Dyadic(origin.y),
          Dyadic(double(p.z)) - Dyadic(origin.z)};
}

Point cross(const Point& a, const Point& b) {
  return {difference_of_products(a[1], b[2], a[2], b[1]), difference_of_products(a[2], b[0], a[0], b[2]),
          difference_of_products(a[0], b[1], a[1], b[0])};
}

Dyadic dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

}  // namespace

ExactTriangle::ExactTriangle(const Ray& ray, const Affine& world_from_object,
                             const std::array<Vec3f, 3>& corners) {
  set(ray.direction, relative(world_from_object, corners[0], ray.origin),
      relative(world_from_object, corners[1], ray.origin),
      relative(world_from_object, corners[2], ray.origin));
}

ExactTriangle::ExactTriangle(const Ray& ray, const std::array<Vec3f, 3>& corners) {
  set(ray.direction, relative(corners[0], ray.origin), relative(corners[1], ray.origin),
      relative(corners[2], ray.origin));
}

void ExactTriangle::set(const Vec3d& direction, const Point& a, const Point& b, const Point& c) {
  const Point d{Dyadic(direction.x), Dyadic(direction.y), Dyadic(direction.z)};
  const Point opposite_a = cross(c, b);
  u = dot(d, opposite_a);
  v = dot(d, cross(a, c));
  w = dot(d, cross(b, a));
  determinant = u + v + w;
  depth = dot(a, opposite_a);
}

bool ExactTriangle::hit() const {
  const int side = determinant.sign();
  return side != 0 && u.sign() * side >= 0 && v.sign() * side >= 0 && w.sign() * side >= 0;
}

int ExactTriangle::compare_t(double limit) const {
  if (!std::isfinite(limit)) return limit > 0.0 ? -1 : 1;
  return (depth - Dyadic(limit) * determinant).sign() * determinant.sign();
}

int ExactTriangle::compare_t(const ExactTriangle& other) const {
  return (depth * other.determinant - other.depth * determinant).sign() * determinant.sign() *
         other.determinant.sign();
}

}  // namespace gridcast::mesh
