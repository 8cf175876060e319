#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

#include "core/error.h"
#include "core/scene/scene_data.h"

namespace gridcast::io {

/// Bounds on what a document may ask for, checked before anything of that size is allocated.
struct GltfLimits {
  std::size_t file_bytes = std::size_t(512) << 20;
  std::size_t json_bytes = std::size_t(64) << 20;
  std::size_t json_depth = 64;
  std::size_t decoded_bytes = std::size_t(8) << 30;  ///< positions, indices and the rest, all meshes together
  /// A small file may not decode to much: at most this much, and so much more for each byte of the file.
  std::size_t decoded_bytes_free = std::size_t(256) << 20;
  std::size_t decoded_bytes_per_byte = 64;
  std::size_t instances = 2'000'000;
  std::size_t nodes = 1'000'000;
};

struct GltfOptions {
  std::optional<std::uint32_t> scene_index;  ///< none = the document's default scene, or its first
  GltfLimits limits;
};

/// Imports GLB or glTF JSON from memory. Nothing is opened: buffers are the BIN chunk or data URIs, any other
/// buffer URI is an error (kInvalidFile); images are never decoded.
/// Errors name the place as a JSON pointer (`/accessors/3/bufferView`): kInvalidFile (breaks glTF 2.0),
/// kUnsupported (needs an extension that changes geometry and is not known here), kLimitExceeded.
[[nodiscard]] Result<scene::SceneData> import_gltf(std::span<const std::byte> bytes,
                                                   const GltfOptions& options = {});

/// The same from a file; relative buffer URIs are read from the file's own folder and below, never elsewhere.
[[nodiscard]] Result<scene::SceneData> import_gltf_file(const std::filesystem::path& path,
                                                        const GltfOptions& options = {});

}  // namespace gridcast::io
