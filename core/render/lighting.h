#pragma once

#include <span>
#include <vector>

#include "core/render/sky.h"
#include "core/scene/scene_data.h"

namespace gridcast::render {

/// What one light does at one point.
struct Illumination {
  Vec3d to_light{0.0};    ///< a shadow ray's direction: the light stands at t = tfar
  double tfar = 0.0;      ///< 1 for a light at a place, +inf for a direction
  Vec3f irradiance{0.F};  ///< on a surface that faces the light, before shadows
};

/// Everything that shines in a picture.
struct Lighting {
  std::vector<scene::Light> lights;
  Sky sky;
  Vec3f head_light{0.F};  ///< radiance of a white matt surface that faces the camera; casts no shadow
  float exposure = 1.F;   ///< what makes radiance suit a display
};

/// The file's own lights, with a black sky; `exposure` and `sky` are set when the picture's brightness is
/// known.
[[nodiscard]] Lighting scene_lights(std::span<const scene::Light> lights);

/// For scenes without lights: a sun over the right shoulder of the camera, the sky and a weak head light.
[[nodiscard]] Lighting default_lights(const scene::Camera& camera);

/// KHR_lights_punctual: lux for directional lights, candela over the square of the distance for others, with
/// range and cone.
[[nodiscard]] Illumination illuminate(const scene::Light& light, const Vec3d& point);

}  // namespace gridcast::render
