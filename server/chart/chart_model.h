#pragma once
// What the chart of speed against accuracy shows, before anything draws it: panels, points, ranges, words.

#include <string>
#include <vector>

#include "core/measure/tradeoff.h"

namespace gridcast::server {

/// How a kind of point looks. Colours tell the precision, shapes the structure.
struct ChartMark {
  std::string name;  ///< for people
  std::string
      color;  ///< #rrggbb, of the palette that colour-blind people can tell apart (M. Okabe, K. Ito, 2008)
  int gnuplot_shape = 0;   ///< gnuplot's number of a point type
  std::string vega_shape;  ///< a symbol of Vega, or an SVG path
};

struct ChartPoint {
  std::size_t row = 0;  ///< of the report
  ChartMark mark;
  double speed = 0.0;   ///< Mrays/s
  double height = 0.0;  ///< errors per million, or a lane of the band for none seen
  bool on_front = false;
};

struct ChartPanel {
  measure::RayClass ray_class = measure::RayClass::kRandom;
  std::string title;
  std::vector<ChartPoint> points;
  [[nodiscard]] std::vector<ChartPoint> front() const;  ///< by speed
};

struct ChartTick {
  double at = 0.0;
  std::string text;
};

/// Speed goes right, errors down, both logarithmic. Points without an error lie in the band between `floor`
/// and `top`, in lanes by precision: there the height says nothing but "none seen, below `floor`".
struct Chart {
  std::string title, subtitle;
  std::string x_title, y_title, floor_text;
  double left = 0.1, right = 10.0;
  double bottom = 1e6, floor = 1.0, top = 0.1;
  std::vector<ChartTick> x_ticks, y_ticks;
  std::vector<ChartPanel> panels;
  std::vector<ChartMark> precisions, structures, yardsticks;  ///< the legend: what occurs
};

/// `name` is the scene's.
[[nodiscard]] Chart make_chart(const measure::TradeoffReport& report, const std::string& name);

}  // namespace gridcast::server
