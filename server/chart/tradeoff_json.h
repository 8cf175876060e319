#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/measure/tradeoff.h"

namespace gridcast::server {

/// The rows of a report as JSON, one object a point of the chart. Rates are per million; one of which none
/// was seen comes with `..._below_per_million`, what it is below with a confidence of 95 %. null: there is no
/// such figure (leaks without closed meshes, errors of t of any hit, bounds of Embree).
[[nodiscard]] nlohmann::ordered_json tradeoff_rows(const measure::TradeoffReport& report);

/// The whole report: `machine`, `scene`, `settings`, `notes`, `rows`. tests/bench/tradeoff.schema.json is its
/// shape. `name` is the scene's.
[[nodiscard]] nlohmann::ordered_json tradeoff_json(const measure::TradeoffReport& report,
                                                   const std::string& name);

/// The rows as CSV (RFC 4180, with a header): the keys of the JSON rows, null an empty field, and every
/// `..._below_per_million` a column of its own.
[[nodiscard]] std::string tradeoff_csv(const measure::TradeoffReport& report);

}  // namespace gridcast::server
