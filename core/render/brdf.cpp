#include "core/render/brdf.h"

#include <algorithm>
#include <numbers>

namespace gridcast::render {
namespace {

// Lights are points, so a perfect mirror would show no highlight of them at all; below this a highlight is
// smaller than a pixel anyway.
constexpr float kMinAlpha = 0.02F;

Vec3f schlick(const Vec3f& f0, const Vec3f& f90, float cosine) {
  const float x = 1.F - std::clamp(cosine, 0.F, 1.F);
  const float x2 = x * x;
  return f0 + (f90 - f0) * (x2 * x2 * x);
}

// Normal distribution and height-correlated masking, "Microfacet Models for Refraction through Rough
// Surfaces", B. Walter, 2007, in the form glTF 2.0 gives in its appendix B.
float ggx(float n_h, float n_v, float n_l, float roughness) {
  const float alpha = std::max(roughness * roughness, kMinAlpha);
  const float a2 = alpha * alpha;
  const float d = n_h * n_h * (a2 - 1.F) + 1.F;
  const float distribution = a2 / (std::numbers::pi_v<float> * d * d);
  const float masking =
      n_l * std::sqrt(n_v * n_v * (1.F - a2) + a2) + n_v * std::sqrt(n_l * n_l * (1.F - a2) + a2);
  return masking > 0.F ? distribution * 0.5F / masking : 0.F;
}

}  // namespace

Vec3f Brdf::fresnel(float cosine) const {
  return schlick(specular, glm::max(Vec3f(1.F - roughness), specular), cosine);
}

Vec3f Brdf::evaluate(const Vec3d& normal, const Vec3d& view, const Vec3d& light) const {
  const float n_l = float(glm::dot(normal, light)), n_v = float(glm::dot(normal, view));
  if (!(n_l > 0.F) || !(n_v > 0.F)) return Vec3f(0.F);
  const Vec3d half = glm::normalize(view + light);
  const float n_h = std::clamp(float(glm::dot(normal, half)), 0.F, 1.F);
  const Vec3f f = schlick(specular, Vec3f(1.F), float(glm::dot(view, half)));
  return (Vec3f(1.F) - f) * diffuse * std::numbers::inv_pi_v<float> + f * ggx(n_h, n_v, n_l, roughness);
}

Brdf make_brdf(const scene::Material& material) {
  const auto unit = [](float value) { return value > 0.F ? std::min(value, 1.F) : 0.F; };
  const Vec3f base(unit(material.base_color[0]), unit(material.base_color[1]), unit(material.base_color[2]));
  const float metallic = unit(material.metallic), transmission = unit(material.transmission);
  const float ior = std::max(material.ior, 1.F);
  const float f0 = (ior - 1.F) / (ior + 1.F);
  Brdf brdf;
  brdf.diffuse = base * (1.F - metallic) * (1.F - transmission);
  brdf.specular = glm::mix(Vec3f(f0 * f0), base, metallic);
  brdf.transmit = base * (1.F - metallic) * transmission;
  brdf.roughness = unit(material.roughness);
  return brdf;
}

}  // namespace gridcast::render
