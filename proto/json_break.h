#pragma once

#include <cstddef>
#include <string_view>

#include "proto/error_table.h"

namespace gridcast::proto {

/// Why and where a text that the fast parser refused is not JSON for us: invalid_json (with the byte),
/// out_of_range (a number that no double or 64-bit integer holds) or too_deep. A second, slower and
/// non-recursive pass, run on refused texts alone.
[[nodiscard]] Problem find_json_break(std::string_view text, std::size_t max_depth);

}  // namespace gridcast::proto
