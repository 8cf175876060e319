#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <stop_token>
#include <vector>

#include "core/error.h"
#include "core/render/film.h"

namespace gridcast::io {

/// 8-bit sRGB PNG of one layer, in memory. Colour is multiplied by the film's exposure, highlights above 0.75
/// are bent towards white, and the picture is opaque (coverage is in the EXR). Depth maps the nearest surface
/// to white and the farthest to dark grey; normals map [-1, 1] to [0, 255]; ids get a stable colour each. The
/// background of depth and ids is black. Takes 3 bytes a pixel beside the film, and what it packs to.
/// kCancelled when stopped on the way.
[[nodiscard]] Result<std::vector<std::byte>> encode_png(const render::Film& film, const render::Layer& layer,
                                                        const std::stop_token& stop = {});

/// One multi-layer OpenEXR file in memory, ZIP compressed: colour as R G B A (not exposed; the attribute
/// `gridcast:exposure` suits a display), other layers as `depth.Z`, `normal.X` ..., all 32-bit float; ids as
/// 32-bit unsigned `instance_id.id`. kCancelled when stopped on the way.
[[nodiscard]] Result<std::vector<std::byte>> encode_exr(const render::Film& film,
                                                        const std::stop_token& stop = {});

/// Writes to a temporary name beside `path`, syncs, then renames: a reader never sees half a file, and a
/// crash leaves the old one. kNotFound when the folder does not exist, else kIo.
[[nodiscard]] Status write_file(const std::filesystem::path& path, std::span<const std::byte> bytes);
/// A regular file of at most `max_bytes`: kNotFound, kInvalidArgument (not a regular file), kLimitExceeded,
/// kIo.
[[nodiscard]] Result<std::vector<std::byte>> read_file(const std::filesystem::path& path,
                                                       std::size_t max_bytes);

}  // namespace gridcast::io
