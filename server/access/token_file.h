#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "server/access/token.h"

namespace gridcast::server::access {

/// The lines of a tokens file: a JSON object each, as to_line() writes it; empty lines and those that begin
/// with # are skipped. Unknown and repeated members, names and digests are errors (kInvalidArgument, with the
/// line's number): a mistyped restriction must not be taken for none.
[[nodiscard]] Result<std::vector<Token>> parse_tokens(std::string_view text);

/// Reads and parses a tokens file. kIo also for one that others may read, or that anyone but its owner may
/// write: whoever writes to it grants himself everything.
[[nodiscard]] Result<std::vector<Token>> read_tokens(const std::string& path);

}  // namespace gridcast::server::access
