#include "core/scene/exact_t.h"

#include <cmath>
#include <optional>

#include "core/math/exact.h"
#include "core/mesh/exact_triangle.h"
#include "core/scene/world_plane.h"

namespace gridcast::scene {
namespace {

/// A double as the sum of two of 26 bits, so that products of parts are exact (T. J. Dekker, 1971): products
/// without error on processors without a fused multiply-add, at a fraction of what std::fma costs there.
struct Parts {
  double whole, high, low;

  explicit Parts(double x) : whole(x) {
    const double scaled = 0x1.0000002p27 * x;
    high = scaled - (scaled - x);
    low = x - high;
  }
};

/// a * b exactly.
TwoTerm product(const Parts& a, const Parts& b) {
  const double rounded = a.whole * b.whole;
  return {rounded, a.low * b.low - (((rounded - a.high * b.high) - a.low * b.high) - a.high * b.low)};
}

/// Adds the unevaluated number, its two halves apart.
void add(TwoTerm& sum, const TwoTerm& term) {
  const TwoTerm high = two_sum(sum.high, term.high);
  sum = {high.high, sum.low + (high.low + term.low)};
}

/// u and v as multiples of 2^-28: their products with a float, and those of 1 - u - v, are exact.
struct Weights {
  double p0, p1, p2;

  Weights(double u, double v) : p1(rounded(u)), p2(rounded(v)) { p0 = 1.0 - p1 - p2; }
  [[nodiscard]] bool near_triangle() const { return std::abs(p0) + std::abs(p1) + std::abs(p2) <= 1.5; }

 private:
  static double rounded(double weight) { return (weight + 0x1.8p24) - 0x1.8p24; }
};

/// o + t d - (A q + T) with q the point of the triangle that the weights give: near 0.
Vec3d gap(const Ray& ray, const Affine& placed, const std::array<Vec3f, 3>& corners, const Weights& weights,
          double t) {
  const Parts t_parts(t);
  TwoTerm q[3];
  for (int axis = 0; axis < 3; ++axis) {
    q[axis] = two_sum(weights.p0 * double(corners[0][axis]), weights.p1 * double(corners[1][axis]));
    add(q[axis], {weights.p2 * double(corners[2][axis]), 0.0});
  }
  const bool turned = placed.linear != Mat3d(1.0);
  Vec3d out;
  for (int row = 0; row < 3; ++row) {
    TwoTerm sum = two_difference(ray.origin[row], placed.translation[row]);
    add(sum, product(t_parts, Parts(ray.direction[row])));
    for (int column = 0; turned && column < 3; ++column) {
      const double a = placed.linear[column][row];
      const TwoTerm along = product(Parts(a), Parts(q[column].high));
      add(sum, {-along.high, -(along.low + a * q[column].low)});
    }
    if (!turned) add(sum, {-q[row].high, -q[row].low});
    out[row] = sum.high + sum.low;
  }
  return out;
}

/// The double nearest to t*, where doubles tell which it is. With r the gap and n the plane's normal,
///   t - t* = c = n . r / n . d,
/// a small number that need not be precise. With u = 2^-53, |.| the largest component (of a matrix the
/// largest row sum), e1 and e2 the edges, K = |A|^2 |e1| |e2|, D = |d|, M = |o - T| + |t| D + 1.5 |A| |p|:
/// * r: sums whose terms add up to M, every one in two halves. The low halves, together below 8 u M, take 12
///   roundings: less than 2^-98 M + u |r|.
/// * n: an edge's image is off by 5 u |A| |e|, a product of two by 11 u K, n by 24 u K < 2^-48 K. |n| <= 2 K.
/// * n . d: off by 3 (2^-48 K) D and 18 u K D for its own roundings, less than 2^-46 K D. Where it is at
/// least
///   2^-26 K D in size, that is 2^-20 of itself.
/// * n . r: likewise off by less than 2^-46 K |r| + 6 K (2^-98 M + u |r|) < 2^-45 K |r| + 2^-95 K M.
/// So c is off by less than (2^-44 |r| + 2^-94 M) K / |n . d| + 2^-19 |c| =: e (and 2^-1000 for underflow).
/// Rounding is monotone: where t
/// - (c + e) and t - (c - e) round to the same double, t* does.
std::optional<double> nearest_double(const Ray& ray, const Affine& placed,
                                     const std::array<Vec3f, 3>& corners, const Hit& hit) {
  const Weights weights(hit.u, hit.v);
  if (!weights.near_triangle()) return std::nullopt;
  const Vec3d p0(corners[0]);
  const Vec3d e1 = Vec3d(corners[1]) - p0, e2 = Vec3d(corners[2]) - p0;
  const double norm = row_sum_norm(placed.linear);
  const double reach = max_abs(ray.direction);
  const double most =
      max_abs(ray.origin - placed.translation) + std::abs(hit.t) * reach +
      1.5 * norm * std::max(max_abs(p0), std::max(max_abs(Vec3d(corners[1])), max_abs(Vec3d(corners[2]))));
  const double area = norm * norm * max_abs(e1) * max_abs(e2);
  // Out of this range products underflow, or parts overflow.
  constexpr double kLeast = 0x1p-300, kMost = 0x1p300;
  if (!(most < kMost && area > kLeast && reach > kLeast && reach < kMost)) return std::nullopt;

  const Vec3d normal = glm::cross(placed.linear * e1, placed.linear * e2);
  const double slope = glm::dot(normal, ray.direction);
  if (!(std::abs(slope) >= 0x1p-26 * area * reach)) return std::nullopt;
  const Vec3d r = gap(ray, placed, corners, weights, hit.t);
  const double correction = glm::dot(normal, r) / slope;
  const double error = (0x1p-44 * max_abs(r) + 0x1p-94 * most + 0x1p-1000) * area / std::abs(slope) +
                       0x1p-19 * std::abs(correction);
  const double low = hit.t - (correction + error), high = hit.t - (correction - error);
  if (low != high) return std::nullopt;
  return low;
}

}  // namespace

// t - t* = height(o + t d) / slope, as in t_error. With 2^-50 relative error of the quotient and the bounds
// of its two sides, the corrected t is off by less than
//   error / slope + 2^-49 |correction| + 2^-53 |t|.
// Where that is too much to promise, integers divide.
double exact_t(const Ray& ray, const Affine& world_from_object, const std::array<Vec3f, 3>& corners,
               const Hit& hit) {
  if (const std::optional<double> t = nearest_double(ray, world_from_object, corners, hit)) return *t;
  const WorldPlane plane(world_from_object, corners);
  const Certified height = plane.height(ray, hit.t);
  const Certified slope = plane.along(ray.direction);
  const double correction = height.high / slope.high;
  const double error = height.error / slope.least_size() + 0x1p-49 * std::abs(correction);
  const double corrected = hit.t - correction;
  if (slope.error <= 0x1p-51 * slope.size() && error <= 0x1p-54 * std::abs(corrected)) return corrected;
  return mesh::ExactTriangle(ray, world_from_object, corners).t();
}

}  // namespace gridcast::scene
