#include "core/render/exposure.h"

#include <algorithm>

#include "core/render/camera.h"
#include "core/render/whitted.h"

namespace gridcast::render {
namespace {

// The pilot picture's longer side: enough for a percentile, a thousandth of a real picture's cost.
constexpr int kPilotSidePx = 64;
constexpr float kTargetLevel = 0.5F;
constexpr double kPercentile = 0.75;
// Unlit surfaces are darker than this in the pilot: their colour is divided by its huge exposure.
constexpr float kDarkest = 1e-30F;
constexpr float kFillShare = 0.33F;

std::vector<float> pilot_luminances(const scene::Scene& scene, const RenderSettings& settings,
                                    const Lighting& lights) {
  const int longer = std::max(settings.width_px, settings.height_px);
  const int width = std::max(1, settings.width_px * kPilotSidePx / longer);
  const int height = std::max(1, settings.height_px * kPilotSidePx / longer);
  const Whitted whitted(scene, lights, settings, 0);
  std::vector<float> luminances;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Ray ray = primary_ray(settings.camera, width, height, x + 0.5, y + 0.5);
      const SurfaceHit hit = scene::intersect(scene, ray, settings.precision, {}, settings.mask);
      if (hit.status != RayStatus::kHit) continue;
      // The weights of red, green and blue in luminance, Rec. 709.
      const float luminance = glm::dot(whitted.radiance(ray, hit), Vec3f(0.2126F, 0.7152F, 0.0722F));
      if (luminance > kDarkest && std::isfinite(luminance)) luminances.push_back(luminance);
    }
  }
  return luminances;
}

}  // namespace

Lighting light_scene(const scene::Scene& scene, const RenderSettings& settings) {
  Lighting lighting = scene_lights(scene.data().lights);
  if (lighting.lights.empty()) return default_lights(settings.camera);

  // Every positive contribution counts in the pilot, however dim the lights are: no ray is left out for
  // being invisible at exposure 1.
  lighting.exposure = std::numeric_limits<float>::max();
  std::vector<float> lit = pilot_luminances(scene, settings, lighting);
  if (lit.empty()) return default_lights(settings.camera);
  const auto middle = lit.begin() + std::ptrdiff_t(kPercentile * double(lit.size() - 1));
  std::nth_element(lit.begin(), middle, lit.end());
  lighting.exposure = std::clamp(kTargetLevel / *middle, 1e-30F, 1e30F);
  lighting.sky.scale = kFillShare / lighting.exposure;
  return lighting;
}

}  // namespace gridcast::render
