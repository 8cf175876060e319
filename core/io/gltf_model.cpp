// The implementation's writers want these, though it does not say so without its file system code.
#include <fstream>
#include <sstream>

#define TINYGLTF_IMPLEMENTATION
#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/gltf_model.h"
#include "core/io/gltf_refusal.h"

namespace gridcast::io {
namespace {

/// What is kept of a kind of object: everything else is dropped before the parser sees it.
struct KeptMembers {
  std::string_view collection;
  std::vector<std::string_view> members;
};

const std::array<KeptMembers, 9>& kept_members() {
  static const std::array<KeptMembers, 9> kept = {{
      {"accessors", {"bufferView", "byteOffset", "componentType", "count", "normalized", "sparse", "type"}},
      {"animations", {"channels", "name", "samplers"}},
      {"bufferViews", {"buffer", "byteLength", "byteOffset", "byteStride", "extensions"}},
      {"cameras", {"name", "orthographic", "perspective", "type"}},
      {"materials", {"doubleSided", "emissiveFactor", "extensions", "name", "pbrMetallicRoughness"}},
      {"meshes", {"name", "primitives", "weights"}},
      {"nodes",
       {"camera", "children", "extensions", "matrix", "mesh", "name", "rotation", "scale", "skin",
        "translation", "weights"}},
      {"scenes", {"name", "nodes"}},
      {"skins", {"inverseBindMatrices", "joints", "name", "skeleton"}},
  }};
  return kept;
}

constexpr std::array<std::string_view, 9> kKeptExtensions = {
    "EXT_mesh_gpu_instancing", "EXT_meshopt_compression",         "KHR_meshopt_compression",
    "KHR_lights_punctual",     "KHR_materials_emissive_strength", "KHR_materials_ior",
    "KHR_materials_unlit",     "KHR_materials_transmission",      "KHR_draco_mesh_compression"};

template <class List>
void keep_members(Json& object, const List& kept) {
  for (auto it = object.begin(); it != object.end();)
    it = std::ranges::find(kept, it.key()) == std::ranges::end(kept) ? object.erase(it) : std::next(it);
}

void keep_extensions(Json& object) {
  const auto extensions = object.find("extensions");
  if (extensions != object.end()) keep_members(*extensions, kKeptExtensions);
}

/// tinygltf reads texture slots and per-object extras even though nobody looks at them here.
void reduce_material(Json& material) {
  static constexpr std::array<std::string_view, 3> kFactors = {"baseColorFactor", "metallicFactor",
                                                               "roughnessFactor"};
  const auto surface = material.find("pbrMetallicRoughness");
  if (surface != material.end()) keep_members(*surface, kFactors);
}

void reduce_primitives(Json& mesh) {
  static constexpr std::array<std::string_view, 6> kMembers = {"attributes", "extensions", "indices",
                                                               "material",   "mode",       "targets"};
  for (Json& primitive : mesh["primitives"]) {
    keep_members(primitive, kMembers);
    keep_extensions(primitive);
    if (!primitive.contains("extensions")) continue;
    // tinygltf refuses indices without a buffer view, which is how Draco primitives have them.
    Json& extensions = primitive["extensions"];
    const auto draco = extensions.find("KHR_draco_mesh_compression");
    if (draco == extensions.end() || !primitive.contains("indices")) continue;
    (*draco)["indices"] = primitive["indices"];
    primitive.erase("indices");
  }
}

void reduce_animation(Json& animation) {
  static constexpr std::array<std::string_view, 2> kChannel = {"sampler", "target"};
  static constexpr std::array<std::string_view, 2> kTarget = {"node", "path"};
  static constexpr std::array<std::string_view, 3> kSampler = {"input", "interpolation", "output"};
  Json channels = Json::array();
  for (Json& channel : animation["channels"]) {
    keep_members(channel, kChannel);
    keep_members(channel["target"], kTarget);
    // A channel without a node is to be ignored (glTF 2.0, or an extension says what it moves).
    if (channel["target"].contains("node")) channels.push_back(std::move(channel));
  }
  animation["channels"] = std::move(channels);
  for (Json& sampler : animation["samplers"]) keep_members(sampler, kSampler);
}

void reduce_element(std::string_view collection, Json& element) {
  keep_extensions(element);
  if (collection == "materials") reduce_material(element);
  if (collection == "meshes") reduce_primitives(element);
  if (collection == "animations") reduce_animation(element);
  if (collection == "cameras")
    for (const char* lens : {"perspective", "orthographic"})
      if (element.contains(lens)) element[lens].erase("extras");
}

/// Gives accessors without a buffer view the one view appended for them.
void add_zero_view(Json& document) {
  Json& views = document["bufferViews"];
  const std::size_t zeros = views.size();
  views.push_back({{"buffer", 0}, {"byteLength", 1}});
  if (!document.contains("accessors")) return;
  for (Json& accessor : document["accessors"])
    if (!accessor.contains("bufferView")) accessor["bufferView"] = zeros;
}

Json reduce(Json document) {
  Json reduced = {{"asset", {{"version", "2.0"}}}};
  for (const auto& [collection, members] : kept_members()) {
    const auto found = document.find(collection);
    if (found == document.end()) continue;
    Json& array = reduced[std::string(collection)] = std::move(*found);
    for (Json& element : array) {
      keep_members(element, members);
      reduce_element(collection, element);
    }
  }
  if (document.contains("scene")) reduced["scene"] = document["scene"];
  keep_extensions(document);
  if (document.contains("extensions")) reduced["extensions"] = std::move(document["extensions"]);
  add_zero_view(reduced);
  return reduced;
}

}  // namespace

tinygltf::Model parse_model(Json document) {
  std::string text;
  {
    const Json reduced = reduce(std::move(document));
    text = reduced.dump();
  }
  tinygltf::TinyGLTF parser;
  parser.SetFsCallbacks({});
  tinygltf::Model model;
  std::string errors;
  std::string warnings;
  if (!parser.LoadASCIIFromString(&model, &errors, &warnings, text.c_str(), unsigned(text.size()), ""))
    refuse_invalid("tinygltf does not accept the document: " + errors.substr(0, 200));
  return model;
}

}  // namespace gridcast::io
