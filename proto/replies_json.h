#pragma once
// Pieces shared by the writers of small replies; not for users of proto.

#include <nlohmann/json.hpp>

#include "proto/error_table.h"
#include "proto/limits.h"

namespace gridcast::proto {

[[nodiscard]] nlohmann::ordered_json limits_json(const Limits& limits);
[[nodiscard]] nlohmann::ordered_json problem_json(const Problem& problem);

}  // namespace gridcast::proto
