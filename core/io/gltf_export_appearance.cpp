#include <algorithm>
#include <cmath>
#include <limits>

#include "core/io/gltf_export_parts.h"

namespace gridcast::io {
namespace {

/// As a double, so that the text names the float exactly. A file's numbers may have left the range of float,
/// and JSON has no infinity.
double number_of(float value) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  return std::isnan(value) ? 0.0 : double(std::clamp(value, -kLargest, kLargest));
}

template <std::size_t N>
OrderedJson numbers_of(const std::array<float, N>& values) {
  OrderedJson array = OrderedJson::array();
  for (const float value : values) array.push_back(number_of(value));
  return array;
}

/// The least power of two that brings every factor to 1 or below: dividing by it is exact.
float emissive_strength(const std::array<float, 3>& emissive) {
  const float largest = *std::ranges::max_element(emissive);
  if (!(largest > 1.F) || std::isinf(largest)) return 1.F;
  int exponent = 0;
  const float fraction = std::frexp(largest, &exponent);
  return std::ldexp(1.F, fraction == 0.5F ? exponent - 1 : exponent);
}

OrderedJson material_extensions(const scene::Material& material, float strength) {
  OrderedJson extensions;
  if (strength != 1.F)
    extensions["KHR_materials_emissive_strength"] = {{"emissiveStrength", double(strength)}};
  if (material.ior != 1.5F) extensions["KHR_materials_ior"] = {{"ior", number_of(material.ior)}};
  if (material.transmission != 0.F)
    extensions["KHR_materials_transmission"] = {{"transmissionFactor", number_of(material.transmission)}};
  if (material.unlit) extensions["KHR_materials_unlit"] = OrderedJson::object();
  return extensions;
}

}  // namespace

OrderedJson describe_material(const scene::Material& material) {
  OrderedJson json;
  if (!material.name.empty()) json["name"] = material.name;
  json["pbrMetallicRoughness"] = {{"baseColorFactor", numbers_of(material.base_color)},
                                  {"metallicFactor", number_of(material.metallic)},
                                  {"roughnessFactor", number_of(material.roughness)}};
  const float strength = emissive_strength(material.emissive);
  std::array<float, 3> factors = material.emissive;
  for (float& factor : factors) factor /= strength;
  json["emissiveFactor"] = numbers_of(factors);
  json["doubleSided"] = material.double_sided;
  OrderedJson extensions = material_extensions(material, strength);
  if (!extensions.empty()) json["extensions"] = std::move(extensions);
  return json;
}

OrderedJson describe_camera(const scene::Camera& camera) {
  OrderedJson json;
  if (!camera.name.empty()) json["name"] = camera.name;
  const bool perspective = camera.kind == scene::CameraKind::kPerspective;
  const char* kind = perspective ? "perspective" : "orthographic";
  json["type"] = kind;
  OrderedJson& lens = json[kind];
  if (perspective) {
    if (camera.aspect_ratio) lens["aspectRatio"] = *camera.aspect_ratio;
    lens["yfov"] = camera.yfov_rad;
  } else {
    lens["xmag"] = camera.xmag;
    lens["ymag"] = camera.ymag;
  }
  lens["znear"] = camera.znear;
  if (camera.zfar) lens["zfar"] = *camera.zfar;
  return json;
}

OrderedJson describe_light(const scene::Light& light) {
  OrderedJson json;
  if (!light.name.empty()) json["name"] = light.name;
  const bool spot = light.kind == scene::LightKind::kSpot;
  json["type"] = spot ? "spot" : (light.kind == scene::LightKind::kPoint ? "point" : "directional");
  json["color"] = numbers_of(light.color);
  json["intensity"] = light.intensity;
  if (light.range) json["range"] = *light.range;
  if (spot)
    json["spot"] = {{"innerConeAngle", light.inner_cone_rad}, {"outerConeAngle", light.outer_cone_rad}};
  return json;
}

Affine place_of(const scene::Light& light) {
  const Vec3d back = -light.direction;
  // The axis farthest from the direction keeps the cross product away from zero.
  const Vec3d sizes = glm::abs(back);
  Vec3d axis{1.0, 0.0, 0.0};
  if (sizes.y <= sizes.x && sizes.y <= sizes.z) axis = {0.0, 1.0, 0.0};
  if (sizes.z < sizes.x && sizes.z < sizes.y) axis = {0.0, 0.0, 1.0};
  const Vec3d right = glm::normalize(glm::cross(axis, back));
  return {Mat3d(right, glm::cross(back, right), back), light.position};
}

}  // namespace gridcast::io
