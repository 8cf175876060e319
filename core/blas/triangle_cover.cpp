#include "core/blas/triangle_cover.h"

#include <utility>
#include <vector>

namespace gridcast::blas {
namespace {

using Polygon = std::vector<Vec3d>;

double area(const Polygon& polygon) {
  Vec3d sum(0.0);
  for (std::size_t i = 2; i < polygon.size(); ++i)
    sum += glm::cross(polygon[i - 1] - polygon[0], polygon[i] - polygon[0]);
  return 0.5 * glm::length(sum);
}

enum class Keep { kAbove, kBelow };

struct Parts {
  Polygon kept;
  Polygon rest;
};

/// The parts of a convex polygon on both sides of a plane across an axis. What lies in the plane is kept.
Parts cut(const Polygon& polygon, int axis, double plane, Keep keep) {
  const double sign = keep == Keep::kAbove ? 1.0 : -1.0;
  Parts parts;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3d& a = polygon[i];
    const Vec3d& b = polygon[i + 1 < polygon.size() ? i + 1 : 0];
    const double da = sign * (a[axis] - plane), db = sign * (b[axis] - plane);
    (da >= 0.0 ? parts.kept : parts.rest).push_back(a);
    if ((da >= 0.0) == (db >= 0.0)) continue;
    const Vec3d crossing = a + (b - a) * (da / (da - db));
    parts.kept.push_back(crossing);
    parts.rest.push_back(crossing);
  }
  return parts;
}

/// What of `polygon` lies outside `box`, as convex parts of more than `negligible` area.
void add_outside(Polygon polygon, const Bounds3f& box, double negligible, std::vector<Polygon>& outside) {
  for (int axis = 0; axis < 3 && !polygon.empty(); ++axis) {
    Parts lower = cut(polygon, axis, double(box.lower[axis]), Keep::kAbove);
    Parts upper = cut(lower.kept, axis, double(box.upper[axis]), Keep::kBelow);
    if (area(lower.rest) > negligible) outside.push_back(std::move(lower.rest));
    if (area(upper.rest) > negligible) outside.push_back(std::move(upper.rest));
    polygon = std::move(upper.kept);
  }
}

}  // namespace

bool covers(std::span<const Bounds3f> boxes, const std::array<Vec3f, 3>& corners) {
  std::vector<Polygon> open{{Vec3d(corners[0]), Vec3d(corners[1]), Vec3d(corners[2])}};
  const Vec3d a = open[0][1] - open[0][0], b = open[0][2] - open[0][0];
  const double negligible = 0x1p-30 * glm::max(glm::dot(a, a), glm::dot(b, b));
  if (area(open[0]) <= negligible) return true;
  for (const Bounds3f& box : boxes) {
    std::vector<Polygon> rest;
    for (Polygon& polygon : open) add_outside(std::move(polygon), box, negligible, rest);
    open = std::move(rest);
  }
  return open.empty();
}

}  // namespace gridcast::blas
