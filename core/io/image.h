#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "core/error.h"
#include "core/render/film.h"

namespace gridcast::io {

/// 8-bit sRGB PNG of one layer, in memory. Colour is tone-mapped (exposure 1, clamped) and keeps alpha; depth
/// maps near to white and far to black; normals map [-1, 1] to [0, 255]; ids get a stable colour each.
[[nodiscard]] Result<std::vector<std::byte>> encode_png(const render::Film& film, const render::Layer& layer);

/// One multi-layer OpenEXR file in memory, ZIP compressed: colour as R G B A, other layers as `depth.Z`,
/// `normal.X` ..., ids as 32-bit unsigned `instance_id.id`.
[[nodiscard]] Result<std::vector<std::byte>> encode_exr(const render::Film& film);

/// Writes to a temporary name beside `path`, then renames: a reader never sees half a file.
[[nodiscard]] Status write_file(const std::filesystem::path& path, std::span<const std::byte> bytes);
[[nodiscard]] Result<std::vector<std::byte>> read_file(const std::filesystem::path& path,
                                                       std::size_t max_bytes);

}  // namespace gridcast::io
