#include "tests/stability/truth.h"

#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::stability {

Expectation box_truth(const Bounds3d& box, const Ray& ray) {
  double best = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const int other = (axis + 1) % 3, third = (axis + 2) % 3;
    if (ray.direction[axis] == 0.0 || box.extent()[other] == 0.0 || box.extent()[third] == 0.0) continue;
    for (const double plane : {box.lower[axis], box.upper[axis]}) {
      const double t = (plane - ray.origin[axis]) / ray.direction[axis];
      const Vec3d p = ray.origin + t * ray.direction;
      const bool inside = p[other] >= box.lower[other] && p[other] <= box.upper[other] &&
                          p[third] >= box.lower[third] && p[third] <= box.upper[third];
      if (inside && t >= ray.tnear && t <= ray.tfar) best = std::min(best, t);
    }
  }
  return best < std::numeric_limits<double>::infinity() ? Expectation::hit({}, best) : Expectation::miss();
}

Expectation every_triangle(const scene::Scene& scene, const Ray& ray) {
  const Hit hit = scene::brute_force(scene, ray, Precision::kRobust);
  return hit.valid() ? Expectation::hit({hit.instance_id, hit.primitive_id}, hit.t) : Expectation::miss();
}

Expectation exactly(const std::optional<measure::exact::Hit>& hit) {
  if (!hit) return Expectation::miss();
  // t is promised within 2^-52 of itself; the nearest double to the true one is off by half of that.
  const double t = hit->at.t.to_double();
  return Expectation::hit(hit->primitive, t, 0x1.8p-52 * std::abs(t));
}

Expectation WorldTruth::closest(const Ray& ray) const {
  return exactly(exact_->closest(ray));
}

}  // namespace gridcast::stability
