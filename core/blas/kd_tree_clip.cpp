#include "core/blas/kd_tree_clip.h"

#include <cmath>
#include <limits>

namespace gridcast::blas {
namespace {

/// A triangle cut by six planes gains at most one corner from each.
struct Polygon {
  std::array<Vec3d, 9> corners;
  std::size_t size = 0;
  void add(const Vec3d& p) { corners[size++] = p; }
};

enum class Keep { kAbove, kBelow };

/// "Reentrant polygon clipping", I. Sutherland, 1974, for one axis-aligned plane.
Polygon clip(const Polygon& polygon, int axis, double plane, Keep keep) {
  Polygon result;
  auto inside = [&](const Vec3d& p) { return keep == Keep::kAbove ? p[axis] >= plane : p[axis] <= plane; };
  for (std::size_t i = 0; i < polygon.size; ++i) {
    const Vec3d& a = polygon.corners[i];
    const Vec3d& b = polygon.corners[i + 1 < polygon.size ? i + 1 : 0];
    if (inside(a)) result.add(a);
    if (inside(a) == inside(b)) continue;
    Vec3d crossing = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]));
    crossing[axis] = plane;
    result.add(crossing);
  }
  return result;
}

struct Clipped {
  Bounds3f box;   ///< of the whole triangle
  double margin;  ///< the planes were moved outward by this
  Polygon polygon;
};

Clipped clip(const std::array<Vec3f, 3>& corners, const Bounds3f& cell) {
  Clipped result{};
  result.box = {};
  for (const Vec3f& corner : corners) {
    result.box.extend(corner);
    result.polygon.add(Vec3d(corner));
  }
  result.margin = 0x1p-46 * double(result.box.magnitude());
  for (int axis = 0; axis < 3; ++axis) {
    if (result.box.lower[axis] < cell.lower[axis])
      result.polygon = clip(result.polygon, axis, double(cell.lower[axis]) - result.margin, Keep::kAbove);
    if (result.box.upper[axis] > cell.upper[axis])
      result.polygon = clip(result.polygon, axis, double(cell.upper[axis]) + result.margin, Keep::kBelow);
  }
  return result;
}

float round_down(double x) {
  const auto nearest = float(x);
  return double(nearest) > x ? std::nextafter(nearest, -std::numeric_limits<float>::infinity()) : nearest;
}
float round_up(double x) {
  const auto nearest = float(x);
  return double(nearest) < x ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
}

}  // namespace

// Why nothing is lost. Let m be the largest coordinate of the triangle and r = 2^-53. A crossing is off by
// d < 16 r m: the quotient by 3 r, the difference and the product by 2 r, each of at most 2 m, the sum by
// 3 r m. The planes are moved outward by e = 2^-46 m > 6 d. Then by induction over the planes, a point P of
// triangle and cell has after k of them a point of the computed polygon within k d: that point is on the kept
// side of the next moved plane because P is on the kept side of the plane itself by e > k d, and the corners
// of the next polygon are off by at most d more. So an empty polygon proves that there is no such P, and a
// polygon's box padded by e contains every P. P also lies in the triangle's box and in the cell; cutting with
// these is what keeps an axis-aligned triangle flat.
std::optional<Bounds3f> clip_triangle(const std::array<Vec3f, 3>& corners, const Bounds3f& cell) {
  auto [box, margin, polygon] = clip(corners, cell);
  if (polygon.size == 0) return std::nullopt;

  Bounds3d tight;
  for (std::size_t i = 0; i < polygon.size; ++i) tight.extend(polygon.corners[i]);
  for (int axis = 0; axis < 3; ++axis) {
    box.lower[axis] = std::max({box.lower[axis], cell.lower[axis], round_down(tight.lower[axis] - margin)});
    box.upper[axis] = std::min({box.upper[axis], cell.upper[axis], round_up(tight.upper[axis] + margin)});
  }
  if (box.empty()) return std::nullopt;
  return box;
}

std::optional<Vec3d> inner_point(const std::array<Vec3f, 3>& corners, const Bounds3f& cell) {
  const auto [box, margin, polygon] = clip(corners, cell);
  if (polygon.size == 0) return std::nullopt;
  Vec3d sum(0.0);
  for (std::size_t i = 0; i < polygon.size; ++i) sum += polygon.corners[i];
  const Vec3d mean = sum / double(polygon.size);
  for (int axis = 0; axis < 3; ++axis) {
    const bool inside = mean[axis] > double(cell.lower[axis]) + 4.0 * margin &&
                        mean[axis] < double(cell.upper[axis]) - 4.0 * margin;
    // A flat tree has flat cells; there the coordinate is that of the cell itself.
    if (!inside && cell.lower[axis] < cell.upper[axis]) return std::nullopt;
  }
  return mean;
}

}  // namespace gridcast::blas
