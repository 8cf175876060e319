#include "core/scene/world_plane.h"

namespace gridcast::scene {
namespace {

Certified3 image(const Mat3d& linear, const Certified3& v) {
  return v[0] * certified(linear[0]) + v[1] * certified(linear[1]) + v[2] * certified(linear[2]);
}

}  // namespace

WorldPlane::WorldPlane(const Affine& world_from_object, const std::array<Vec3f, 3>& corners)
    : linear_(world_from_object.linear), translation_(certified(world_from_object.translation)) {
  const Certified3 p0 = certified(Vec3d(corners[0]));
  corner_ = image(linear_, p0);
  normal_ = cross(image(linear_, certified(Vec3d(corners[1])) - p0),
                  image(linear_, certified(Vec3d(corners[2])) - p0));
}

// The translation is subtracted from the point first: the two are of one size where the instance is far off.
Certified WorldPlane::height(const Certified3& p) const {
  return dot(normal_, (p - translation_) - corner_);
}

Certified WorldPlane::height(const Ray& ray, double t) const {
  return height(certified(ray.origin) + Certified(t) * certified(ray.direction));
}

Certified WorldPlane::height_of_object_point(const Vec3d& p) const {
  return dot(normal_, image(linear_, certified(p)) - corner_);
}

}  // namespace gridcast::scene
