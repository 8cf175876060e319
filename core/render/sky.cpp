#include "core/render/sky.h"

namespace gridcast::render {
namespace {

const Vec3f kZenith(0.12F, 0.20F, 0.34F);
const Vec3f kHorizon(0.46F, 0.52F, 0.58F);
const Vec3f kGround(0.085F, 0.092F, 0.105F);

// Cosine-weighted means of the gradient below over the hemispheres that look straight up, sideways and
// straight down. The factors are integrals over y of sqrt(y) or 1 - smoothstep, times 2 y (up, down) or (4 /
// pi) sqrt(1 - y^2) (each half of the sideways hemisphere).
const Vec3f kAmbientUp = glm::mix(kHorizon, kZenith, 0.8F);
const Vec3f kAmbientDown = glm::mix(kGround, kHorizon, 0.0043F);
const Vec3f kAmbientSide =
    0.5F * glm::mix(kHorizon, kZenith, 0.6102F) + 0.5F * glm::mix(kGround, kHorizon, 0.0764F);

}  // namespace

Vec3f Sky::radiance(const Vec3d& direction) const {
  const float y = float(direction.y);
  if (y >= 0.F) return scale * glm::mix(kHorizon, kZenith, std::sqrt(y));
  // The horizon fades into the ground within a few degrees, or it would be a hard line in every mirror.
  return scale * glm::mix(kHorizon, kGround, glm::smoothstep(0.F, 0.12F, -y));
}

Vec3f Sky::ambient(const Vec3d& normal) const {
  const float y = float(normal.y);
  return scale *
         (y >= 0.F ? glm::mix(kAmbientSide, kAmbientUp, y) : glm::mix(kAmbientSide, kAmbientDown, -y));
}

Vec3f Sky::glossy(const Vec3d& direction, float roughness) const {
  return glm::mix(radiance(direction), ambient(direction), glm::smoothstep(0.F, 1.F, roughness));
}

}  // namespace gridcast::render
