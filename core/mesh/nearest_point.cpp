#include "core/mesh/nearest_point.h"

#include <algorithm>
#include <tuple>

namespace gridcast::mesh {
namespace {

double length(const Vec3d& v) {
  return std::sqrt(glm::dot(v, v));
}

/// On the segment from a to b: `share` is that of b.
struct OnEdge {
  double share;
  Vec3d point;
};

OnEdge nearest_on_edge(const Vec3d& a, const Vec3d& b) {
  // The same end first whichever triangle asks.
  const bool swap = std::tie(b.x, b.y, b.z) < std::tie(a.x, a.y, a.z);
  const Vec3d& first = swap ? b : a;
  const Vec3d& second = swap ? a : b;
  const Vec3d edge = second - first;
  const double along = -glm::dot(first, edge);
  const double whole = glm::dot(edge, edge);
  const double share = along > 0.0 ? std::min(along / whole, 1.0) : 0.0;
  const Vec3d point = share < 1.0 ? first + share * edge : second;
  return {swap ? 1.0 - share : share, point};
}

void take_nearer(NearestPoint& best, double u, double v, const Vec3d& point) {
  const double distance = length(point);
  if (distance < best.distance) best = {distance, u, v, point};
}

}  // namespace

NearestPoint nearest_to_origin(const Vec3d& p0, const Vec3d& p1, const Vec3d& p2) {
  const OnEdge e01 = nearest_on_edge(p0, p1);
  NearestPoint best{length(e01.point), e01.share, 0.0, e01.point};
  const OnEdge e12 = nearest_on_edge(p1, p2);
  take_nearer(best, 1.0 - e12.share, e12.share, e12.point);
  const OnEdge e20 = nearest_on_edge(p2, p0);
  take_nearer(best, 0.0, 1.0 - e20.share, e20.point);

  const Vec3d a = p1 - p0, b = p2 - p0;
  const Vec3d normal = glm::cross(a, b);
  const double square = glm::dot(normal, normal);
  if (!(square > 0.0)) return best;
  const double u = glm::dot(normal, glm::cross(b, p0)) / square;
  const double v = glm::dot(normal, glm::cross(p0, a)) / square;
  const double rest = 1.0 - u - v;
  if (u > 0.0 && v > 0.0 && rest > 0.0) take_nearer(best, u, v, p0 + u * a + v * b);
  return best;
}

}  // namespace gridcast::mesh
