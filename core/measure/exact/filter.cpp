#include "core/measure/exact/filter.h"

#include <algorithm>
#include <cmath>

namespace gridcast::measure::exact {
namespace {

constexpr Wide kUnit = std::numeric_limits<Wide>::epsilon() / 2;  // u
constexpr Wide kInfinity = std::numeric_limits<Wide>::infinity();

Wide3 cross(const Wide3& a, const Wide3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Wide dot(const Wide3& a, const Wide3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Wide largest_of(const Wide3& v) {
  return std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])});
}

/// 1 certainly positive, -1 certainly negative, 0 too close to 0 to say.
int sign(Wide value, Wide error) {
  return int(value > error) - int(value < -error);
}

}  // namespace

WideRay::WideRay(const Ray& ray)
    : origin{ray.origin.x, ray.origin.y, ray.origin.z},
      direction{ray.direction.x, ray.direction.y, ray.direction.z},
      largest(largest_of(direction)) {}

Interval WideRay::inside(const WideBox& box) const {
  // A quotient is off by u of itself.
  const auto down = [](Wide t) { return t - 2 * kUnit * std::abs(t); };
  const auto up = [](Wide t) { return t + 2 * kUnit * std::abs(t); };
  Interval in{-kInfinity, kInfinity};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Wide d = direction[axis];
    if (d == 0) {
      if (box.lower[axis] > 0 || box.upper[axis] < 0) return {kInfinity, -kInfinity};
      continue;
    }
    const Wide enter = (d > 0 ? box.lower[axis] : box.upper[axis]) / d;
    const Wide exit = (d > 0 ? box.upper[axis] : box.lower[axis]) / d;
    in.enter = std::max(in.enter, down(enter));
    in.exit = std::min(in.exit, up(exit));
  }
  return in;
}

InstanceFrame::InstanceFrame(const Affine& world_from_object, double extent, const WideRay& ray) : error_(0) {
  for (int row = 0; row < 3; ++row) {
    const auto r = std::size_t(row);
    rows_[r] = {world_from_object.linear[0][row], world_from_object.linear[1][row],
                world_from_object.linear[2][row]};
    offset_[r] = Wide(world_from_object.translation[row]) - ray.origin[r];
    const Wide absolute = std::abs(rows_[r][0]) + std::abs(rows_[r][1]) + std::abs(rows_[r][2]);
    // The difference is off by u |T - o|, each product by u, each of the three sums by u of what it adds up:
    // together below 5 u (|A| |p| + |T - o|). The rest of the 8 pays for the rounding of this bound.
    error_ = std::max(error_, 8 * kUnit * (absolute * Wide(extent) + std::abs(offset_[r])));
  }
}

Wide3 InstanceFrame::point(const Vec3f& p) const {
  const Wide3 wide{p.x, p.y, p.z};
  return {dot(rows_[0], wide) + offset_[0], dot(rows_[1], wide) + offset_[1],
          dot(rows_[2], wide) + offset_[2]};
}

WideBox InstanceFrame::image(const Vec3d& lower, const Vec3d& upper) const {
  WideBox box;
  for (std::size_t row = 0; row < 3; ++row) {
    Wide low = 0, high = 0;
    for (int c = 0; c < 3; ++c) {
      const Wide a = rows_[row][std::size_t(c)];
      low += a * Wide(a > 0 ? lower[c] : upper[c]);
      high += a * Wide(a > 0 ? upper[c] : lower[c]);
    }
    // The sums are corners' x but for their order, off by at most as much.
    box.lower[row] = low + offset_[row] - error_;
    box.upper[row] = high + offset_[row] + error_;
    // The margin itself is added with a rounding, of at most u of the sum.
    box.lower[row] -= 2 * kUnit * std::abs(box.lower[row]);
    box.upper[row] += 2 * kUnit * std::abs(box.upper[row]);
  }
  return box;
}

/// Bounds, with m the largest computed component, e the error of one, d the largest component of the
/// direction. A component of x_i x x_j is off by 4 m e + 2 e^2 because its factors are, and by 4.1 u m^2
/// because of rounding; W_ij = direction . (x_i x x_j) by three times that times d plus 18.1 u d m^2 for its
/// own sums: together below 32 d (m + e) (e + u m) =: edge. Their sum: below 3 edge + 36 u d m^2 <= 4.25
/// edge. x_0 . (x_1 x x_2) has m for d and x_0 off by e, which adds 6 e (m + e)^2: below 40 (m + e)^2 (e + u
/// m). Then t = V / S is off by (V's error + |t| S's error + u |V|) / (|S| - S's error).
FilterAnswer InstanceFrame::test(const WideRay& ray, const std::array<Vec3f, 3>& corners) const {
  const Wide3 x0 = point(corners[0]), x1 = point(corners[1]), x2 = point(corners[2]);
  const Wide m = std::max({largest_of(x0), largest_of(x1), largest_of(x2)});
  const Wide relative = (m + error_) * (error_ + kUnit * m);
  const Wide edge_error = 32 * ray.largest * relative;
  const Wide3 x12 = cross(x1, x2);
  const Wide w12 = dot(ray.direction, x12);
  const Wide w20 = dot(ray.direction, cross(x2, x0));
  const Wide w01 = dot(ray.direction, cross(x0, x1));
  const int s12 = sign(w12, edge_error), s20 = sign(w20, edge_error), s01 = sign(w01, edge_error);
  const bool positive = s12 > 0 || s20 > 0 || s01 > 0;
  const bool negative = s12 < 0 || s20 < 0 || s01 < 0;
  if (positive && negative) return {};

  FilterAnswer answer{s12 != 0 && s20 != 0 && s01 != 0 ? Verdict::kHit : Verdict::kUnsure};
  const Wide sum = w12 + w20 + w01;
  const Wide sum_error = Wide(4.25) * edge_error;
  if (!(std::abs(sum) > sum_error)) return {Verdict::kUnsure};
  const Wide volume = dot(x0, x12);
  const Wide t = volume / sum;
  const Wide t_error =
      (40 * (m + error_) * relative + 2 * kUnit * std::abs(volume) + std::abs(t) * sum_error) /
      (std::abs(sum) - sum_error);
  // One part in a hundred is more than the rounding of the bound itself; 2 u |t| that of the sums.
  answer.low = t - Wide(1.01) * t_error - 2 * kUnit * std::abs(t);
  answer.high = t + Wide(1.01) * t_error + 2 * kUnit * std::abs(t);
  return answer;
}

}  // namespace gridcast::measure::exact
