#pragma once

#include <nlohmann/json.hpp>

#include "server/chart/chart_model.h"

namespace gridcast::server {

/// The chart as a Vega-Lite 5 specification with its data inside: a page draws it as it is. Every point
/// carries its row of tradeoff_rows().
[[nodiscard]] nlohmann::ordered_json vega_chart(const Chart& chart, const measure::TradeoffReport& report);

}  // namespace gridcast::server
