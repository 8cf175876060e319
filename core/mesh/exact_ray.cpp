#include "core/mesh/exact_ray.h"

#include <limits>

#include "core/math/exact.h"

// How far the object-space ray (o', d') is from (o*, d*), in the largest component. With B the stored inverse
// of A and e the transform's round_trip_error, |AB - I| <= e <= 2^-5:
//
// 1. |A o' + T - o| <= e |o - T| and |A d' - d| <= e |d|, as affine.h says.
// 2. A^-1 = B (AB)^-1, so |A^-1| <= |B| / (1 - e) <= 33/32 |B|.
// 3. Together |o' - o*| <= 33/32 |B| e |o - T| and |d' - d*| <= 33/32 |B| e |d|. Underflow in B (o - T) adds
//    less than 2^-1070.
//
// Where that is too much (ill-conditioned or anisotropic transforms), Newton's iteration x <- x + B r with
// the residual r = y - A x in twice double's precision: r is off by r' <= 2^-98 (|A||x| + |y|) (four products
// and five sums, each of relative error 2^-104 or less in the size of its terms, and the rounding of r
// itself, u |r|), so
//   |x + B r - x*| <= |A^-1 - B| |r*| + |B| r' + rounding of B r and of the sum
//                  <= |B| (33/32 e + 4 u) |r| + |B| r' + u |x|     with |A^-1 - B| = |A^-1 (I - AB)|.
namespace gridcast::mesh {
namespace {

constexpr double kUnit = 0x1p-53;
constexpr double kTiny = 0x1p-1000;
/// Bounds are computed in double by a handful of operations each; this covers their rounding.
constexpr double kRoundUp = 1.0 + 0x1p-40;

/// A vector in object space and a bound of its distance from the true image.
struct Image {
  Vec3d value;
  double error;
};

/// y - A x of one row, where y = y.high + y.low.
double residual_row(const Mat3d& a, const Vec3d& x, const TwoTerm& y, int row) {
  TwoTerm sum = y;
  for (int column = 0; column < 3; ++column) {
    const TwoTerm product = two_product(-a[column][row], x[column]);
    const TwoTerm high = two_sum(sum.high, product.high);
    sum = two_sum(high.high, high.low + (sum.low + product.low));
  }
  return sum.high + sum.low;
}

/// Newton's iteration for A x = y, until it gains nothing more.
Image refine(const InstanceTransform& transform, const TwoTerm (&y)[3], double size, Image image) {
  const Mat3d& a = transform.world_from_object().linear;
  const Mat3d& b = transform.object_from_world_linear();
  const double norm_a = row_sum_norm(a), norm_b = row_sum_norm(b);
  constexpr int kMostSteps = 16;  // the error shrinks by 2^4 or more in each, until rounding is all there is
  for (int step = 0; step < kMostSteps; ++step) {
    const Vec3d& x = image.value;
    const Vec3d residual{residual_row(a, x, y[0], 0), residual_row(a, x, y[1], 1),
                         residual_row(a, x, y[2], 2)};
    const Vec3d better = x + b * residual;
    const double residual_error = 0x1p-98 * (norm_a * max_abs(x) + size) + kTiny;
    const double error =
        kRoundUp * (norm_b * ((33.0 / 32.0 * transform.round_trip_error() + 5.0 * kUnit) * max_abs(residual) +
                              residual_error) +
                    kUnit * max_abs(better)) +
        kTiny;
    if (!(error < image.error)) break;
    image = {better, error};
  }
  return image;
}

Image direction_image(const InstanceTransform& transform, const Vec3d& d, double inverse_error) {
  return {transform.vector_to_object(d), kRoundUp * inverse_error * max_abs(d) + kTiny};
}

bool is_identity(const Mat3d& m) {
  return m == Mat3d(1.0);
}

/// Drift per length of the ray beyond which it is worth to refine: edge functions are then undecided, and t
/// close to others', a few times in 2^30.
constexpr double kWorthRefining = 0x1p-34;

/// Within it, squares of lengths in double and lengths in float stay in range.
constexpr double kMostReach = 0x1p110;

}  // namespace

ExactImage exact_image(const Ray& ray, const InstanceTransform& transform, const Bounds3f& bounds) {
  Image origin{transform.point_to_object(ray.origin), 0.0};
  Image direction{transform.vector_to_object(ray.direction), 0.0};
  const Affine& placed = transform.world_from_object();
  const double mesh_size = double(bounds.magnitude());
  bool is_image = false;
  if (is_identity(placed.linear) && is_identity(transform.object_from_world_linear())) {
    for (int axis = 0; axis < 3; ++axis)
      origin.error =
          std::max(origin.error, std::abs(two_difference(ray.origin[axis], placed.translation[axis]).low));
    is_image = origin.error == 0.0;
  } else {
    const double inverse_error =
        33.0 / 32.0 * row_sum_norm(transform.object_from_world_linear()) * transform.round_trip_error();
    const double offset = max_abs(ray.origin - placed.translation);
    origin.error = kRoundUp * inverse_error * offset + kTiny;
    direction = direction_image(transform, ray.direction, inverse_error);
    const double reach = max_abs(origin.value) + mesh_size;
    const double turn = direction.error / max_abs(direction.value);
    if (!(origin.error + turn * reach <= kWorthRefining * reach)) {
      const TwoTerm y[3] = {two_difference(ray.origin.x, placed.translation.x),
                            two_difference(ray.origin.y, placed.translation.y),
                            two_difference(ray.origin.z, placed.translation.z)};
      origin = refine(transform, y, offset, origin);
      const TwoTerm z[3] = {{ray.direction.x, 0.0}, {ray.direction.y, 0.0}, {ray.direction.z, 0.0}};
      direction = refine(transform, z, max_abs(ray.direction), direction);
    }
  }

  const double reach = max_abs(origin.value) + mesh_size;
  const double turn = direction.error / max_abs(direction.value);
  constexpr double kMostTurn = 0x1p-6;
  const bool is_close = turn <= kMostTurn && reach + origin.error < kMostReach;
  const double drift = is_close ? kRoundUp * (origin.error + turn * reach) : 0.0;
  return {origin.value, direction.value, drift, is_close, is_image};
}

bool ExactRay::prepare(ObjectRay& object, const Ray& ray, const InstanceTransform& transform,
                       const TriangleMesh& triangles, const Bounds3f& bounds, double far) {
  world = &ray;
  world_from_object = &transform.world_from_object();
  mesh = &triangles;
  const ExactImage image = exact_image(ray, transform, bounds);
  const bool may_hit = object.prepare({image.origin, image.direction, ray.tnear, far}, bounds, image.drift);
  if (image.is_close && !may_hit) return false;
  attach_to(object, image);
  return true;
}

void ExactRay::attach_to(ObjectRay& object, const ExactImage& image) {
  is_close = image.is_close;
  is_image = image.is_image;
  object.exact = this;
  corner_error = is_close ? kRoundUp * (0x1p-50 * object.distance + 2.25 * image.drift)
                          : std::numeric_limits<double>::infinity();
  t_error = kRoundUp * (1.125 * image.drift + 0x1p-48 * object.distance) / std::abs(object.direction_z);
  object.side_error = 16.5 * corner_error * (object.distance + corner_error) + kTiny;
}

}  // namespace gridcast::mesh
