#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "core/error.h"

namespace gridcast::io {

/// The two parts of a glTF file, as views of its bytes. `bin` is the binary chunk of a GLB, if any.
struct GlbEnvelope {
  std::span<const std::byte> json;
  std::optional<std::span<const std::byte>> bin;
};

/// Finds the chunks of a GLB; bytes without the GLB magic are taken as glTF JSON. Refuses (kInvalidFile) what
/// starts like neither, a wrong version, a total length that is not the number of bytes, and chunks that pass
/// the end or come in the wrong order. Chunks of unknown type, or beyond the second, are ignored as glTF 2.0
/// asks.
[[nodiscard]] Result<GlbEnvelope> open_envelope(std::span<const std::byte> bytes);

}  // namespace gridcast::io
