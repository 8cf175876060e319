#pragma once
// Instances in JSON, read the same way wherever they stand.

#include "proto/json_reader.h"
#include "proto/scene_request.h"

namespace gridcast::proto {

/// mesh_id and, where they are given, transform, name and mask; all are among the members that `object`
/// knows.
[[nodiscard]] AddInstanceRequest read_added_instance(const ObjectReader& object, const Limits& limits);

/// transform, mask and name, as far as they are given, which are among the members that `object` knows. None
/// of them is a problem of `node`, which holds them.
[[nodiscard]] ChangeInstanceRequest read_change(const JsonNode& node, const ObjectReader& object,
                                                const Limits& limits);

}  // namespace gridcast::proto
