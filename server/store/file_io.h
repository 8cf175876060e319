#pragma once
// Files as the store writes and reads them.

#include <initializer_list>
#include <string>
#include <string_view>

#include "core/error.h"

namespace gridcast::server::store {

/// Names of files that are not finished; what bears one was left by a crash.
inline constexpr std::string_view kTemporary = "tmp-";

/// Writes the pieces, one after the other, and an fsync. `path` is not there yet; after an error it may be,
/// in part.
[[nodiscard]] Status write_new_file(const std::string& path, std::initializer_list<std::string_view> pieces);
/// All of it. kNotFound when it is not there, kIo.
[[nodiscard]] Result<std::string> read_file(const std::string& path);

/// fsync of a folder: makes the names in it durable.
[[nodiscard]] Status sync_folder(const std::string& path);
/// kLimitExceeded for a full disk or quota, kIo for anything else; names `path` and the system's reason.
[[nodiscard]] Error system_error(std::string_view doing, const std::string& path, int error_number);

}  // namespace gridcast::server::store
