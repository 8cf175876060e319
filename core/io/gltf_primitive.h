#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/io/gltf_import.h"

namespace gridcast::io {

/// The vertices of one primitive, decoded.
struct PrimitiveVertices {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;  ///< as stored; empty = none
  std::uint32_t influences = 0;
  std::vector<std::uint16_t> joints;  ///< [vertices, influences]
  std::vector<float> weights;         ///< [vertices, influences]
  std::vector<scene::MorphTarget> targets;
};

/// One primitive, decoded. `indices` counts up from 0 when the file has none.
struct PrimitiveData {
  PrimitiveVertices vertices;
  std::vector<std::uint32_t> indices;
};

/// Reads a primitive that has positions, decoding Draco data where it is. Throws Refusal: positions that are
/// not finite or larger than 1e18, indices out of range, attributes of different lengths or odd types.
[[nodiscard]] PrimitiveData read_primitive(ImportContext& context, const tinygltf::Primitive& primitive,
                                           const std::string& where);

/// The triangles of a list, strip or fan, in order; nothing for points and lines. Winding is that of
/// glTF 2.0, section 3.7.2.1 (odd triangles of a strip are turned).
[[nodiscard]] std::vector<mesh::Triangle> make_triangles(int mode, const std::vector<std::uint32_t>& indices);

}  // namespace gridcast::io
