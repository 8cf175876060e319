#pragma once

#include <nlohmann/json.hpp>

namespace gridcast::server {

/// What figures were measured on: processor, instruction sets, compiler, and the Embree beside us with its
/// version and build type.
[[nodiscard]] nlohmann::ordered_json machine_json();

}  // namespace gridcast::server
