#include "core/render/lighting.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace gridcast::render {
namespace {

constexpr double kPi = std::numbers::pi;

Vec3f color_of(const scene::Light& light) {
  return {light.color[0], light.color[1], light.color[2]};
}

// The fade KHR_lights_punctual recommends, so that a light ends at its range without an edge.
double range_fade(const scene::Light& light, double distance) {
  if (!light.range || !(*light.range > 0.0)) return 1.0;
  const double ratio = distance / *light.range;
  return std::clamp(1.0 - ratio * ratio * ratio * ratio, 0.0, 1.0);
}

double cone_fade(const scene::Light& light, const Vec3d& to_light, double distance) {
  if (light.kind != scene::LightKind::kSpot) return 1.0;
  const double cos_angle = -glm::dot(light.direction, to_light) / distance;
  const double cos_outer = std::cos(light.outer_cone_rad), cos_inner = std::cos(light.inner_cone_rad);
  const double fade = std::clamp((cos_angle - cos_outer) / std::max(1e-3, cos_inner - cos_outer), 0.0, 1.0);
  return fade * fade;
}

}  // namespace

Lighting scene_lights(std::span<const scene::Light> lights) {
  Lighting lighting;
  lighting.sky.scale = 0.F;
  for (const scene::Light& light : lights)
    if (light.intensity > 0.0 && std::isfinite(light.intensity)) lighting.lights.push_back(light);
  return lighting;
}

Lighting default_lights(const scene::Camera& camera) {
  const Mat3d& axes = camera.world_from_camera.linear;
  scene::Light sun;
  sun.kind = scene::LightKind::kDirectional;
  sun.direction = -glm::normalize(0.75 * axes[0] + Vec3d(0.0, 0.85, 0.0) + 0.40 * axes[2]);
  sun.color = {1.F, 0.96F, 0.89F};
  sun.intensity = 0.85 * kPi;
  Lighting lighting;
  lighting.lights = {sun};
  lighting.head_light = Vec3f(0.06F);
  return lighting;
}

Illumination illuminate(const scene::Light& light, const Vec3d& point) {
  if (light.kind == scene::LightKind::kDirectional) {
    return {-light.direction, std::numeric_limits<double>::infinity(),
            float(light.intensity) * color_of(light)};
  }
  const Vec3d to_light = light.position - point;
  const double distance = glm::length(to_light);
  if (!(distance > 0.0) || !std::isfinite(distance)) return {};
  const double fade = range_fade(light, distance) * cone_fade(light, to_light, distance);
  return {to_light, 1.0, float(light.intensity * fade / (distance * distance)) * color_of(light)};
}

}  // namespace gridcast::render
