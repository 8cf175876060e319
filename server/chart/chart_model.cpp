#include "server/chart/chart_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "core/measure/embree_yardstick.h"
#include "server/number_text.h"

namespace gridcast::server {
namespace {

/// Decades that the band of points without an error is high.
constexpr double kBandDecades = 0.9;
/// Room beside the slowest and the fastest point.
constexpr double kSideRoom = 1.3;
constexpr const char* kGrey = "#555555";

struct NamedMark {
  const char* key;
  ChartMark mark;
};

const std::array<NamedMark, 3>& precision_marks() {
  static const std::array<NamedMark, 3> marks{{{"fast", {"fast", "#E69F00", 7, "circle"}},
                                               {"robust", {"robust (default)", "#0072B2", 7, "circle"}},
                                               {"exact", {"exact", "#009E73", 7, "circle"}}}};
  return marks;
}

const std::array<NamedMark, 7>& structure_marks() {
  static const std::array<NamedMark, 7> marks{{{"wide_bvh", {"wide BVH", kGrey, 7, "circle"}},
                                               {"compact_bvh", {"compact BVH", kGrey, 8, "square"}},
                                               {"bvh", {"binary BVH", kGrey, 5, "square"}},
                                               {"kd_tree", {"kd-tree", kGrey, 9, "triangle-up"}},
                                               {"embree", {"Embree's tree, our test", kGrey, 13, "diamond"}},
                                               {"brute_force", {"brute force", kGrey, 11, "triangle-down"}},
                                               {"auto", {"automatic", kGrey, 15, "cross"}}}};
  return marks;
}

const std::array<NamedMark, 2>& yardstick_marks() {
  static const std::array<NamedMark, 2> marks{
      {{"default", {"default", "#D55E00", 2, "M-1,-1L1,1M-1,1L1,-1"}},
       {"robust", {"ROBUST", "#CC79A7", 3, "M-1,-1L1,1M-1,1L1,-1M0,-1.3L0,1.3M-1.3,0L1.3,0"}}}};
  return marks;
}

template <class Marks>
const ChartMark& find_mark(const Marks& marks, const std::string& key) {
  const auto found = std::ranges::find_if(marks, [&](const NamedMark& named) { return named.key == key; });
  return found == marks.end() ? marks.back().mark : found->mark;
}

std::string embree_name(const std::string& mode) {
  const measure::EmbreeInfo info = measure::embree_info();
  const std::string build = info.assertions == "yes"  ? ", assertions compiled in"
                            : info.assertions == "no" ? ", no assertions"
                                                      : "";
  return "Embree " + info.version + " " + mode + build;
}

bool is_yardstick(const measure::TradeoffRow& row) {
  return row.engine == "embree";
}

ChartMark mark_of(const measure::TradeoffRow& row) {
  if (is_yardstick(row)) {
    ChartMark mark = find_mark(yardstick_marks(), row.precision);
    mark.name = embree_name(mark.name);
    return mark;
  }
  ChartMark mark = find_mark(structure_marks(), row.structure);
  mark.name += ", " + row.precision;
  mark.color = find_mark(precision_marks(), row.precision).color;
  return mark;
}

/// From the floor upwards: Embree, fast, robust, exact.
double lane_of(const measure::TradeoffRow& row) {
  if (is_yardstick(row)) return 0.125;
  return row.precision == "fast" ? 0.375 : row.precision == "robust" ? 0.625 : 0.875;
}

std::string title_of(measure::RayClass ray_class) {
  using measure::RayClass;
  auto name = std::string(measure::to_string(ray_class));
  switch (ray_class) {
    case RayClass::kRandom:
      return name + ": any direction";
    case RayClass::kEdge:
      return name + ": aimed at edges";
    case RayClass::kVertex:
      return name + ": aimed at vertices";
    case RayClass::kGrazing:
      return name + ": nearly in a plane";
    case RayClass::kAxis:
      return name + ": along an axis";
    case RayClass::kCoherent:
      return name + ": a camera's pixels";
    case RayClass::kDiffuse:
      return name + ": bounces";
    case RayClass::kShadow:
      return name + ": any hit to a light";
  }
  return name;
}

std::string short_number(double value) {
  char text[32];
  if (value >= 1e6)
    std::snprintf(text, sizeof(text), "%g M", value / 1e6);
  else if (value >= 1e3)
    std::snprintf(text, sizeof(text), "%g k", value / 1e3);
  else
    std::snprintf(text, sizeof(text), "%.3g", value);
  return text;
}

/// 1, 2 and 5 times the powers of ten within the range; powers alone where that is too many.
std::vector<ChartTick> ticks_within(double low, double high) {
  constexpr std::array<double, 3> kSteps{1.0, 2.0, 5.0};
  const bool few = high / low > 300.0;
  std::vector<ChartTick> ticks;
  for (double power = std::pow(10.0, std::floor(std::log10(low))); power <= high; power *= 10.0)
    for (const double step : kSteps)
      if (step * power >= low && step * power <= high && (step == 1.0 || !few))
        ticks.push_back({step * power, short_number(step * power)});
  return ticks;
}

void set_ranges(Chart& chart, const measure::TradeoffReport& report) {
  double slowest = 1e30, fastest = 1e-30;
  std::uint64_t rays = 1;
  for (const measure::TradeoffRow& row : report.rows) {
    slowest = std::min(slowest, row.mrays_per_s);
    fastest = std::max(fastest, row.mrays_per_s);
    rays = std::max(rays, row.accuracy.rays);
  }
  chart.left = std::max(slowest, 1e-6) / kSideRoom;
  chart.right = std::max(fastest, 1e-6) * kSideRoom;
  chart.x_ticks = ticks_within(chart.left, chart.right);
  chart.floor = measure::Rate{0, rays}.below_per_million();
  chart.top = chart.floor * std::pow(10.0, -kBandDecades);
  chart.bottom = std::max(1e6, 10.0 * chart.floor);
  for (double power = chart.bottom; power > 2.0 * chart.floor; power /= 10.0)
    chart.y_ticks.push_back({power, short_number(power)});
  chart.floor_text = "none seen: below " + short_number(std::round(chart.floor));
}

void describe(Chart& chart, const measure::TradeoffReport& report, const std::string& name) {
  chart.title = "Speed against accuracy: " + name;
  chart.subtitle = grouped(report.world_triangles) + " triangles in " + grouped(report.instances) +
                   (report.instances == 1 ? " instance; " : " instances; ") +
                   grouped(report.options.accuracy_rays) + " rays a panel against exact answers; median of " +
                   std::to_string(report.options.repeat) + " timings, " +
                   std::to_string(report.options.threads) +
                   (report.options.threads == 1 ? " thread" : " threads");
  chart.x_title = "speed in Mrays/s (right is better)";
  chart.y_title = "errors per million rays: missed, false, wrong (up is better)";
}

void add_to_legend(std::vector<ChartMark>& legend, const ChartMark& mark) {
  if (std::ranges::none_of(legend, [&](const ChartMark& known) { return known.name == mark.name; }))
    legend.push_back(mark);
}

void add_point(Chart& chart, ChartPanel& panel, const measure::TradeoffRow& row, std::size_t index) {
  ChartPoint& point = panel.points.emplace_back();
  point.row = index;
  point.mark = mark_of(row);
  point.speed = row.mrays_per_s;
  const measure::Rate errors = row.accuracy.errors();
  // What was seen may be fewer than three: then it lies just below the floor, where it belongs.
  point.height = errors.count > 0 ? std::max(errors.per_million(), chart.floor * 1.05)
                                  : chart.floor * std::pow(10.0, -kBandDecades * lane_of(row));
  point.on_front = row.on_front;
  if (is_yardstick(row)) {
    add_to_legend(chart.yardsticks, point.mark);
  } else {
    add_to_legend(chart.structures, find_mark(structure_marks(), row.structure));
    add_to_legend(chart.precisions, find_mark(precision_marks(), row.precision));
  }
}

}  // namespace

std::vector<ChartPoint> ChartPanel::front() const {
  std::vector<ChartPoint> found;
  std::ranges::copy_if(points, std::back_inserter(found), [](const ChartPoint& p) { return p.on_front; });
  std::ranges::sort(found, {}, &ChartPoint::speed);
  return found;
}

Chart make_chart(const measure::TradeoffReport& report, const std::string& name) {
  Chart chart;
  describe(chart, report, name);
  set_ranges(chart, report);
  for (std::size_t i = 0; i < report.rows.size(); ++i) {
    const measure::TradeoffRow& row = report.rows[i];
    if (chart.panels.empty() || chart.panels.back().ray_class != row.ray_class)
      chart.panels.push_back({row.ray_class, title_of(row.ray_class), {}});
    add_point(chart, chart.panels.back(), row, i);
  }
  return chart;
}

}  // namespace gridcast::server
