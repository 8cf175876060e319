#pragma once

#include <array>
#include <string_view>

#include "core/math/ray.h"

namespace gridcast {

/// The names on the wire and the command line, in the order of Precision.
inline constexpr std::array<std::string_view, 3> kPrecisionNames{"fast", "robust", "exact"};

[[nodiscard]] constexpr std::string_view to_string(Precision precision) {
  return kPrecisionNames[std::size_t(precision)];
}

/// `name` is one of kPrecisionNames; anything else is `robust`, the default.
[[nodiscard]] constexpr Precision to_precision(std::string_view name) {
  for (std::size_t i = 0; i < kPrecisionNames.size(); ++i)
    if (kPrecisionNames[i] == name) return Precision(i);
  return Precision::kRobust;
}

}  // namespace gridcast
