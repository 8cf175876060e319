#pragma once
// A ray's way as indented lines for people.

#include <string>

#include "core/scene/explain.h"

namespace gridcast::server {

/// One line a step, indented by what it lies in, then the hit and the counts. Ends with a line break.
[[nodiscard]] std::string explain_text(const scene::Explanation& told);

}  // namespace gridcast::server
