#pragma once
// The one place that includes tinygltf. It is compiled here without its file system and image code, so
// nothing it could be talked into opening or decoding is even linked.

#define TINYGLTF_NO_FS
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
// First, because tinygltf would include it with hidden visibility.
#include <nlohmann/json.hpp>
#include <tiny_gltf.h>

#include "core/io/gltf_json.h"

namespace gridcast::io {

/// Reduces a checked document to what is read from it, and parses that with tinygltf. Buffers, images,
/// textures, samplers, extras and unread extensions are gone from the model; accessors without a buffer view
/// name the view zero_view(model), which stands for zeros; indices of Draco primitives are in the extension.
/// Throws Refusal.
[[nodiscard]] tinygltf::Model parse_model(Json document);

/// The index just past the document's own buffer views.
[[nodiscard]] inline int zero_view(const tinygltf::Model& model) {
  return int(model.bufferViews.size()) - 1;
}

}  // namespace gridcast::io
