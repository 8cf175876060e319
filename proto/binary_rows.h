#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

#include "core/math/ray_batch.h"
#include "proto/error_table.h"
#include "proto/limits.h"
#include "proto/media_type.h"

namespace gridcast::proto {

/// What a binary body of rows of numbers holds.
struct RowKind {
  std::string_view media_type;
  std::string_view name;    ///< of many, as problems say it: "points"
  std::size_t columns = 0;  ///< numbers a row
};

/// Takes a body of [N, columns] little-endian floats or doubles, by the media type's dtype, and no other
/// parameter; float32 where there is none. `rows` points into `body`. A problem where the type, the length or
/// the number of rows is not allowed.
[[nodiscard]] std::optional<Problem> read_binary_rows(const RowKind& kind, const MediaType& type,
                                                      std::string_view body, const Limits& limits,
                                                      ScalarType& scalar, std::span<const std::byte>& rows);

}  // namespace gridcast::proto
