#include "core/io/gltf_check.h"

#include <algorithm>
#include <array>
#include <string>

#include "core/io/gltf_refusal.h"

namespace gridcast::io {
namespace {

/// Required extensions a document may name. Those that change geometry are implemented; the rest only change
/// how surfaces look or carry notes.
constexpr std::array kAcceptedExtensions = {
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "KHR_animation_pointer",
    "EXT_texture_webp",
    "EXT_texture_avif",
    "MSFT_texture_dds",
    "EXT_lights_image_based",
    "FB_ngon_encoding",
};

bool is_accepted(const std::string& name) {
  return name.starts_with("KHR_materials_") ||
         std::ranges::find(kAcceptedExtensions, name) != kAcceptedExtensions.end();
}

void check_asset(const Cursor& root) {
  const Cursor asset = root.require("asset");
  const Cursor version = asset.require("version");
  version.expect_string();
  const auto& text = version.json().get_ref<const std::string&>();
  if (!text.starts_with("2.")) version.refuse_here("only glTF 2.x is read");
  const auto minimum = asset.find("minVersion");
  if (!minimum) return;
  minimum->expect_string();
  if (minimum->json().get_ref<const std::string&>() != "2.0")
    refuse(ErrorCode::kUnsupported, "the document needs a glTF version beyond 2.0", minimum->where());
}

void check_extension_names(const Cursor& root) {
  if (const auto used = root.find("extensionsUsed"))
    for (std::size_t i = 0, n = used->size(); i < n; ++i) used->element(i).expect_string();
  const auto required = root.find("extensionsRequired");
  if (!required) return;
  for (std::size_t i = 0, n = required->size(); i < n; ++i) {
    const Cursor name = required->element(i);
    name.expect_string();
    const auto& text = name.json().get_ref<const std::string&>();
    if (!is_accepted(text))
      refuse(ErrorCode::kUnsupported, "the required extension '" + text.substr(0, 64) + "' is not supported",
             name.where());
  }
}

/// Collections whose entries are never read must still be arrays of objects, with objects as extensions.
void check_collections(const Cursor& root) {
  for (const char* name : {"accessors", "animations", "buffers", "bufferViews", "cameras", "images",
                           "materials", "meshes", "nodes", "samplers", "scenes", "skins", "textures"}) {
    root.each_object(name, [](const Cursor& item, std::size_t) {
      if (const auto extensions = item.find("extensions")) extensions->expect_object();
      if (const auto label = item.find("name")) label->expect_string();
    });
  }
  const auto extensions = root.find("extensions");
  if (!extensions) return;
  extensions->expect_object();
  for (const auto& [name, value] : extensions->json().items())
    if (!value.is_object())
      extensions->refuse_here("the extension '" + name.substr(0, 64) + "' must be an object");
}

}  // namespace

void check_document(const Json& document, const GltfLimits& limits) {
  const Cursor root(document);
  root.expect_object();
  check_asset(root);
  check_extension_names(root);
  check_collections(root);
  if (const auto nodes = root.find("nodes"); nodes && nodes->size() > limits.nodes)
    refuse(ErrorCode::kLimitExceeded, "the document has too many nodes", "/nodes");
  check_storage(root);
  check_meshes(root);
  check_nodes(root);
  check_forest(root);
  check_animations(root);
  check_appearance(root);
}

}  // namespace gridcast::io
