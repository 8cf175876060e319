#pragma once
// An instance squeezed so much along one line that of a ray in the plane across it exact mode has an image
// good to some 2^(most - 106) only: neither doubles nor Newton's iteration can do better.

#include <cmath>

#include "core/math/affine.h"
#include "core/math/ray.h"
#include "tests/support/random.h"

namespace gridcast::test {

/// Object space: x lies along a direction of the world's xy plane that doubles cannot divide by, z is the
/// world's, y is squeezed by 2^-`most` or up to
/// 2^4 less. Rays of plane y = 0 are exact in the world, and nowhere else.
class SqueezedPlane {
 public:
  explicit SqueezedPlane(Random& random, double most = 88.0)
      : third_(Vec3f(float(1.0 + random.uniform()), float(random.uniform(0.3, 1.0)), 0.F)),
        squeeze_(std::exp2(-random.uniform(most - 4.0, most))) {}

  [[nodiscard]] Affine world_from_object() const {
    return {Mat3d(3.0 * third_, squeeze_ * Vec3d(-third_.y, third_.x, 0.0), Vec3d(0, 0, 1)), Vec3d(0.0)};
  }
  /// From (-k / 3, 0, -1) along y, to y = 1 at t = 1.
  [[nodiscard]] Ray ray_across(int k) const { return {origin(k), world_from_object().linear[1]}; }
  /// From (-k / 3, 0, -1), k a whole number that 3 does not divide, to (x, 0, z) at t = 1.
  [[nodiscard]] Ray ray_to(int k, int x, double z) const {
    return {origin(k), double(k + 3 * x) * third_ + Vec3d(0, 0, z + 1.0)};
  }

 private:
  [[nodiscard]] Vec3d origin(int k) const { return -double(k) * third_ + Vec3d(0, 0, -1); }

  Vec3d third_;  ///< a third of the image of the x axis
  double squeeze_;
};

}  // namespace gridcast::test
