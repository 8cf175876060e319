#pragma once
// Everything about a document that must hold before a general-purpose parser may look at it: property types,
// indices in range, sizes within what they are cut from, nodes that form a forest. The checks throw Refusal.

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/io/gltf_json.h"

namespace gridcast::io {

/// Bytes of one element, with the padding that glTF puts between the columns of small matrices.
struct ElementLayout {
  std::size_t components = 0;
  std::size_t component_bytes = 0;
  std::size_t element_bytes = 0;
};
/// components = 0 for an unknown type or component type.
[[nodiscard]] ElementLayout element_layout(std::string_view type, std::int64_t component_type);

inline constexpr std::int64_t kByte = 5120, kUnsignedByte = 5121, kShort = 5122, kUnsignedShort = 5123,
                              kUnsignedInt = 5125, kFloat = 5126;

/// Counts larger than this are nonsense in any file this reads, and their products fit 64 bits with room.
inline constexpr std::int64_t kMaxCount = std::int64_t(1) << 40;

inline constexpr const char* kMeshoptExtensions[] = {"EXT_meshopt_compression", "KHR_meshopt_compression"};

/// The compression of a buffer view, or nothing; `view` must outlive the result.
[[nodiscard]] std::optional<Cursor> meshopt_extension(const Cursor& extensions);

/// All of the checks below, and asset, extensions and scenes.
void check_document(const Json& root, const GltfLimits& limits);

// The parts, by what they look at.
void check_storage(const Cursor& root);     ///< buffers, bufferViews, accessors
void check_meshes(const Cursor& root);      ///< meshes and what a primitive names
void check_nodes(const Cursor& root);       ///< nodes, skins, scenes
void check_forest(const Cursor& root);      ///< no cycles, no second parent
void check_animations(const Cursor& root);  ///< animations
void check_appearance(const Cursor& root);  ///< materials, cameras, lights

}  // namespace gridcast::io
