#include "core/measure/exact/triangle.h"

namespace gridcast::measure::exact {
namespace {

using Vec = std::array<Dyadic, 3>;

Vec to_vec(const Vec3d& v) {
  return {v.x, v.y, v.z};
}

Vec cross(const Vec& a, const Vec& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Dyadic dot(const Vec& a, const Vec& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// A p + T - origin.
Vec from_origin(const Affine& affine, const Vec3d& origin, const Vec3f& p) {
  Vec x;
  for (int row = 0; row < 3; ++row) {
    Dyadic sum = Dyadic(affine.translation[row]) - Dyadic(origin[row]);
    for (int c = 0; c < 3; ++c) sum = sum + Dyadic(affine.linear[c][row]) * Dyadic(double(p[c]));
    x[std::size_t(row)] = sum;
  }
  return x;
}

}  // namespace

std::optional<TriangleHit> intersect(const Ray& ray, const Affine& world_from_object,
                                     const std::array<Vec3f, 3>& corners) {
  const Vec x0 = from_origin(world_from_object, ray.origin, corners[0]);
  const Vec x1 = from_origin(world_from_object, ray.origin, corners[1]);
  const Vec x2 = from_origin(world_from_object, ray.origin, corners[2]);
  const Vec direction = to_vec(ray.direction);
  const Vec x12 = cross(x1, x2);
  const Dyadic w12 = dot(direction, x12);
  const Dyadic w20 = dot(direction, cross(x2, x0));
  const Dyadic w01 = dot(direction, cross(x0, x1));
  const bool positive = w12.sign() > 0 || w20.sign() > 0 || w01.sign() > 0;
  const bool negative = w12.sign() < 0 || w20.sign() < 0 || w01.sign() < 0;
  if (positive == negative) return std::nullopt;

  const Dyadic sum = w12 + w20 + w01;
  TriangleHit hit{Ratio(dot(x0, x12), sum)};
  if (compare(hit.t, ray.tnear) < 0 || compare(hit.t, ray.tfar) > 0) return std::nullopt;
  hit.u = Ratio(w20, sum).to_double();
  hit.v = Ratio(w01, sum).to_double();
  return hit;
}

}  // namespace gridcast::measure::exact
