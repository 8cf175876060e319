#include "core/io/gltf_import.h"

namespace gridcast::io {
namespace {

/// A number of a material extension, or `otherwise`.
float extension_number(const tinygltf::Material& material, const char* extension, const char* key,
                       float otherwise) {
  const auto found = material.extensions.find(extension);
  if (found == material.extensions.end() || !found->second.Has(key)) return otherwise;
  const tinygltf::Value& value = found->second.Get(key);
  return value.IsNumber() ? float(value.GetNumberAsDouble()) : otherwise;
}

}  // namespace

void import_materials(const tinygltf::Model& model, scene::SceneData& out) {
  for (const tinygltf::Material& source : model.materials) {
    scene::Material& material = out.materials.emplace_back();
    const tinygltf::PbrMetallicRoughness& surface = source.pbrMetallicRoughness;
    material.name = source.name;
    for (std::size_t c = 0; c < 4 && c < surface.baseColorFactor.size(); ++c)
      material.base_color[c] = float(surface.baseColorFactor[c]);
    const float strength =
        extension_number(source, "KHR_materials_emissive_strength", "emissiveStrength", 1.F);
    for (std::size_t c = 0; c < 3 && c < source.emissiveFactor.size(); ++c)
      material.emissive[c] = float(source.emissiveFactor[c]) * strength;
    material.metallic = float(surface.metallicFactor);
    material.roughness = float(surface.roughnessFactor);
    material.transmission = extension_number(source, "KHR_materials_transmission", "transmissionFactor", 0.F);
    material.ior = extension_number(source, "KHR_materials_ior", "ior", 1.5F);
    material.double_sided = source.doubleSided;
    material.unlit = source.extensions.contains("KHR_materials_unlit");
  }
}

}  // namespace gridcast::io
