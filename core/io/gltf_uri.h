#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace gridcast::io {

/// The bytes of a base64 `data:` URI of type application/octet-stream or application/gltf-buffer. Throws
/// Refusal; `where` is the pointer it names.
[[nodiscard]] std::vector<std::byte> decode_data_uri(std::string_view uri, const std::string& where);

/// The path that a relative URI (percent-encoded) names. Throws Refusal for anything but a plain path below
/// the document's folder: a scheme, an absolute path, `..`, backslashes, control characters.
[[nodiscard]] std::string check_relative_uri(std::string_view uri, const std::string& where);

/// Reads the file that a relative URI (percent-encoded) names, below `folder` after every symbolic link is
/// followed, at most `max_bytes` of it. Throws Refusal for anything else: what check_relative_uri
/// refuses, a link out of the folder, something that is not a plain file.
[[nodiscard]] std::vector<std::byte> read_relative_uri(std::string_view uri,
                                                       const std::filesystem::path& folder,
                                                       std::size_t max_bytes, const std::string& where);

/// The whole of a plain file (not a folder, pipe or device). Throws Refusal: kNotFound, kIo, kLimitExceeded.
[[nodiscard]] std::vector<std::byte> read_plain_file(const std::filesystem::path& path, std::size_t max_bytes,
                                                     const std::string& where);

}  // namespace gridcast::io
