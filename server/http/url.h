#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/query.h"

namespace gridcast::server {

/// Undoes %XX (and, in queries, `+`). Nothing when an escape is malformed or yields a control character.
enum class PlusSign { kLiteral, kSpace };
[[nodiscard]] std::optional<std::string> percent_decode(std::string_view text, PlusSign plus);

/// `a=1&b=2`, decoded. Nothing when an escape is malformed.
[[nodiscard]] std::optional<proto::QueryParameters> parse_query(std::string_view text);

/// The decoded segments between the slashes of an absolute path ("/" has none). Nothing when an escape is
/// malformed or a segment is empty, "." or "..", or holds a slash once decoded: no route has such names.
[[nodiscard]] std::optional<std::vector<std::string>> split_path(std::string_view path);

}  // namespace gridcast::server
