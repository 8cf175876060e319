#pragma once

#include <string>
#include <vector>

#include "core/measure/tradeoff.h"
#include "server/http/http_types.h"

namespace gridcast::server {

/// What was measured in the other forms that it comes in beside JSON: CSV and Vega-Lite, and SVG and PNG,
/// which gnuplot draws when they are asked for: drawing_unavailable where there is none. `name` is the
/// scene's.
[[nodiscard]] std::vector<HttpResponse::Form> tradeoff_forms(const measure::TradeoffReport& report,
                                                             const std::string& name);

}  // namespace gridcast::server
