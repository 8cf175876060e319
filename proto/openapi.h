#pragma once

#include <string_view>

namespace gridcast::proto {

/// The contract as served at /openapi.json: the text of openapi.json, which a test keeps equal to
/// openapi.yaml.
[[nodiscard]] std::string_view openapi_json();

}  // namespace gridcast::proto
