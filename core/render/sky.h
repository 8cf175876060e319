#pragma once

#include "core/math/vec.h"

namespace gridcast::render {

/// The surroundings of a scene: a vertical gradient from the ground over a bright horizon to the zenith. It
/// is the background, what mirrors show beside the scene, and the ambient light.
struct Sky {
  float scale = 1.F;  ///< times the colours below, to suit the scene's lights

  /// Radiance from `direction` (unit).
  [[nodiscard]] Vec3f radiance(const Vec3d& direction) const;
  /// Mean radiance over the cosine-weighted hemisphere around `normal`: what a white matt surface shows.
  [[nodiscard]] Vec3f ambient(const Vec3d& normal) const;
  /// Radiance a glossy surface sees around `direction`: sharp at roughness 0, ambient at 1.
  [[nodiscard]] Vec3f glossy(const Vec3d& direction, float roughness) const;
};

}  // namespace gridcast::render
