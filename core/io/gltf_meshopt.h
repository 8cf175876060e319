#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/io/gltf_model.h"
#include "core/io/gltf_refusal.h"

namespace gridcast::io {

/// The EXT_ or KHR_meshopt_compression object of a buffer view of a model, or null.
[[nodiscard]] const tinygltf::Value* meshopt_of(const tinygltf::BufferView& view);

/// Decompresses a buffer view: count * byteStride bytes, with its filter applied. Throws Refusal: bad data,
/// sizes that do not fit the mode or filter, the second version of the vertex codec (KHR allows it,
/// kUnsupported).
[[nodiscard]] std::vector<std::byte> decode_meshopt(const tinygltf::Value& extension,
                                                    std::span<const std::byte> packed, Budget& budget,
                                                    const std::string& where);

}  // namespace gridcast::io
