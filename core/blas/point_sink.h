#pragma once
// What a search around a point does with the triangles it comes to.

#include <cstdint>

#include "core/math/bounds.h"

namespace gridcast::blas {

/// Squared distance from a point to a closed box, 0 inside; off by less than 2^-49 of itself.
inline double squared_distance(const Vec3d& point, const Bounds3f& box) {
  const Vec3d outside = glm::max(glm::max(Vec3d(box.lower) - point, point - Vec3d(box.upper)), Vec3d(0.0));
  return glm::dot(outside, outside);
}

/// Looks at the triangles near a point of object space. A search offers every triangle that has a point
/// within the radius at least once, some perhaps several times, nearer boxes first, and others too: how far a
/// triangle is, the sink finds out itself. It narrows the radius as it goes.
class PointSink {
 public:
  PointSink(const PointSink&) = delete;
  PointSink& operator=(const PointSink&) = delete;
  virtual ~PointSink() = default;

  [[nodiscard]] const Vec3d& center() const { return center_; }
  [[nodiscard]] double radius() const { return radius_; }
  /// Nothing of interest is in a box whose squared_distance() is above.
  [[nodiscard]] double limit() const { return limit_; }
  virtual void offer(std::uint32_t primitive_id) = 0;

 protected:
  PointSink(const Vec3d& center, double radius) : center_(center) { set_radius(radius); }
  void set_radius(double radius) {
    radius_ = radius;
    // Covers the rounding of both squares; the floor is for squares that underflow.
    limit_ = radius * radius * (1.0 + 0x1p-40) + 0x1p-1000;
  }

 private:
  Vec3d center_;
  double radius_ = 0.0;
  double limit_ = 0.0;
};

}  // namespace gridcast::blas
