#pragma once

#include <string>

#include "server/chart/chart_model.h"

namespace gridcast::server {

enum class PlotFormat { kSvg, kPng };

/// A script for gnuplot 5 that draws the chart to its standard output, with its data inside. Names from files
/// stand in quotes that gnuplot does not look into.
[[nodiscard]] std::string gnuplot_script(const Chart& chart, PlotFormat format);

}  // namespace gridcast::server
