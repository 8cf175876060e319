#include <string>

#include "core/io/gltf_check.h"
#include "core/io/gltf_uri.h"

namespace gridcast::io {
namespace {

void check_number_in(const Cursor& object, const char* key) {
  if (const auto value = object.find(key)) (void)value->number();
}

void check_boolean_in(const Cursor& object, const char* key) {
  if (const auto value = object.find(key); value && !value->json().is_boolean())
    value->refuse_here("must be true or false");
}

/// Textures are not read, but a slot that is not one means a document nobody should trust.
void check_texture_slot(const Cursor& owner, const char* key) {
  const auto slot = owner.find(key);
  if (!slot) return;
  (void)slot->require("index").integer(0, kMaxCount);
  for (const char* factor : {"scale", "strength"}) check_number_in(*slot, factor);
}

void check_materials(const Cursor& root) {
  root.each_object("materials", [](const Cursor& material, std::size_t) {
    material.expect_numbers_in("emissiveFactor", 3);
    check_boolean_in(material, "doubleSided");
    for (const char* key : {"normalTexture", "occlusionTexture", "emissiveTexture"})
      check_texture_slot(material, key);
    if (const auto surface = material.find("pbrMetallicRoughness")) {
      surface->expect_numbers_in("baseColorFactor", 4);
      check_number_in(*surface, "metallicFactor");
      check_number_in(*surface, "roughnessFactor");
      for (const char* key : {"baseColorTexture", "metallicRoughnessTexture"})
        check_texture_slot(*surface, key);
    }
    const auto extensions = material.find("extensions");
    if (!extensions) return;
    for (const auto& item : extensions->json().items())
      if (!item.value().is_object()) extensions->refuse_here("material extensions must be objects");
  });
}

/// Images are never opened here; whoever opens them later must find no way out of the folder.
void check_images(const Cursor& root) {
  root.each_object("images", [](const Cursor& image, std::size_t) {
    const auto uri = image.find("uri");
    if (!uri) return;
    uri->expect_string();
    const auto& text = uri->json().get_ref<const std::string&>();
    if (!text.starts_with("data:")) (void)check_relative_uri(text, uri->where());
  });
}

void check_cameras(const Cursor& root) {
  root.each_object("cameras", [](const Cursor& camera, std::size_t) {
    const Cursor type = camera.require("type");
    const bool perspective = type.json() == "perspective";
    if (!perspective && type.json() != "orthographic")
      type.refuse_here("must be perspective or orthographic");
    const Cursor lens = camera.require(perspective ? "perspective" : "orthographic");
    for (const char* key : {"yfov", "xmag", "ymag", "znear", "zfar", "aspectRatio"})
      check_number_in(lens, key);
    (void)lens.require("znear");
    for (const char* key : {"xmag", "ymag"})
      if (!perspective) (void)lens.require(key);
    if (perspective) (void)lens.require("yfov");
  });
}

void check_lights(const Cursor& root) {
  const auto extensions = root.find("extensions");
  if (!extensions) return;
  const auto lights = extensions->find("KHR_lights_punctual");
  if (!lights) return;
  lights->each_object("lights", [](const Cursor& light, std::size_t) {
    const Cursor type = light.require("type");
    const Json& name = type.json();
    if (name != "directional" && name != "point" && name != "spot")
      type.refuse_here("must be directional, point or spot");
    light.expect_numbers_in("color", 3);
    check_number_in(light, "intensity");
    check_number_in(light, "range");
    if (name != "spot") return;
    const Cursor spot = light.require("spot");
    spot.expect_object();
    check_number_in(spot, "innerConeAngle");
    check_number_in(spot, "outerConeAngle");
  });
}

}  // namespace

void check_appearance(const Cursor& root) {
  check_materials(root);
  check_cameras(root);
  check_lights(root);
  check_images(root);
}

}  // namespace gridcast::io
