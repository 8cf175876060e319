#include "server/chart/chart_gnuplot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>

namespace gridcast::server {
namespace {

constexpr int kMaxColumns = 4;
constexpr int kPanelWidthPx = 350, kPanelHeightPx = 330;
constexpr int kHeadPx = 76, kLegendPx = 118;
constexpr int kLeftPx = 86, kRightPx = 24, kFootPx = 46;
constexpr const char* kInk = "#222222";
constexpr const char* kFrontColor = "#999999";

/// Single quotes: gnuplot expands nothing within.
std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'') result += "''";
    // One line, whatever a file's name holds.
    else
      result.push_back(static_cast<unsigned char>(c) < 0x20 ? ' ' : c);
  }
  return result + "'";
}

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof(text), pattern, values...);
  return text;
}

std::string ticks(const std::vector<ChartTick>& list) {
  std::string text = "(";
  for (const ChartTick& tick : list) {
    if (text.size() > 1) text += ", ";
    text += quoted(tick.text) + format(" %.9g", tick.at);
  }
  return text + ")";
}

/// Where things are on the page, in pixels from its lower left corner.
class Page {
 public:
  explicit Page(std::size_t panels)
      : columns_(int(std::min<std::size_t>(std::max<std::size_t>(panels, 2), kMaxColumns))),
        rows_(int((std::max<std::size_t>(panels, 1) + std::size_t(columns_) - 1) / std::size_t(columns_))) {}

  /// Wide enough for the head and the legend, however few panels there are.
  [[nodiscard]] int width() const { return kLeftPx + std::max(columns_, 3) * kPanelWidthPx + kRightPx; }
  [[nodiscard]] int height() const { return kHeadPx + rows_ * kPanelHeightPx + kFootPx + kLegendPx; }
  [[nodiscard]] bool at_left(std::size_t panel) const { return column(panel) == 0; }

  /// Margins of one panel, as gnuplot wants them.
  [[nodiscard]] std::string margins(std::size_t panel) const {
    const int left = kLeftPx + column(panel) * kPanelWidthPx;
    const int top = height() - kHeadPx - row(panel) * kPanelHeightPx;
    return margins(left, left + kPanelWidthPx - 22, top - kPanelHeightPx + 56, top - 24);
  }
  [[nodiscard]] std::string legend_margins() const {
    return margins(kLeftPx, width() - kRightPx, 8, kLegendPx - 14);
  }
  [[nodiscard]] double legend_width() const { return double(width() - kLeftPx - kRightPx); }
  /// A place on the page as a share of its size.
  [[nodiscard]] std::string at(double x_px, double from_top_px) const {
    return format("screen %.6f, screen %.6f", x_px / width(), 1.0 - from_top_px / height());
  }
  [[nodiscard]] double middle_of_panels_px() const { return kHeadPx + 0.5 * rows_ * kPanelHeightPx; }

 private:
  [[nodiscard]] int column(std::size_t panel) const { return int(panel) % columns_; }
  [[nodiscard]] int row(std::size_t panel) const { return int(panel) / columns_; }
  [[nodiscard]] std::string margins(int left, int right, int bottom, int top) const {
    return format("set lmargin at screen %.6f\nset rmargin at screen %.6f\n", double(left) / width(),
                  double(right) / width()) +
           format("set bmargin at screen %.6f\nset tmargin at screen %.6f\n", double(bottom) / height(),
                  double(top) / height());
  }
  int columns_, rows_;
};

std::string head(const Chart& chart, const Page& page, PlotFormat out) {
  std::string text =
      out == PlotFormat::kSvg ? "set terminal svg noenhanced dynamic" : "set terminal pngcairo noenhanced";
  text += format(" size %d,%d font 'sans-serif,12' background rgb 'white'\n", page.width(), page.height());
  text += format("set multiplot\nset border lc rgb '%s'\nset tics textcolor rgb '%s' nomirror\n", kInk, kInk);
  text += "set label 1 " + quoted(chart.title) + " at " + page.at(kLeftPx, 24) + " font 'sans-serif,18'\n";
  text += "set label 2 " + quoted(chart.subtitle) + " at " + page.at(kLeftPx, 50) + "\n";
  text += "set label 3 " + quoted(chart.y_title) + " at " + page.at(20, page.middle_of_panels_px()) +
          " rotate by 90 center\n";
  return text;
}

/// A block of data, one point a line.
std::string block(const std::string& name, std::span<const ChartPoint> points) {
  std::string text = "$" + name + " << END\n";
  for (const ChartPoint& point : points) text += format("%.9g %.9g\n", point.speed, point.height);
  return text + "END\n";
}

std::string points_style(const ChartMark& mark) {
  // Stars and crosses are lines: thicker, so that they are seen among the filled shapes.
  const bool is_line = mark.gnuplot_shape < 4;
  return format(" with points pt %d ps %.2f lw %.1f lc rgb '%s' notitle", mark.gnuplot_shape,
                is_line ? 1.5 : 1.15, is_line ? 2.6 : 1.0, mark.color.c_str());
}

std::string panel_axes(const Chart& chart, const Page& page, std::size_t index) {
  std::string text = page.margins(index);
  text += "set title " + quoted(chart.panels[index].title) + " offset 0,-0.6\n";
  text += "set xlabel " + quoted(chart.x_title) + " offset 0,0.4\n";
  text += page.at_left(index) ? "set format y\n" : "set format y ''\n";
  text += format("set logscale xy\nset xrange [%.9g:%.9g]\n", chart.left, chart.right);
  text += format("set yrange [%.9g:%.9g]\n", chart.bottom, chart.top);
  text += "set xtics " + ticks(chart.x_ticks) + "\n";
  std::vector<ChartTick> y_ticks = chart.y_ticks;
  if (!page.at_left(index))
    for (ChartTick& tick : y_ticks) tick.text.clear();
  text += "set ytics " + ticks(y_ticks) + "\nset grid xtics ytics lw 0.5 lc rgb '#dddddd'\n";
  // The band of those without an error.
  text += format("set object 1 rectangle from graph 0, first %.9g to graph 1, graph 1 ", chart.floor);
  text += "behind fillcolor rgb '#eef3ee' fillstyle solid noborder\n";
  text +=
      format("set arrow 1 from graph 0, first %.9g to graph 1, first %.9g nohead ", chart.floor, chart.floor);
  text += format("dt 2 lw 1.2 lc rgb '%s'\n", kInk);
  text += "set label 4 " + quoted(chart.floor_text) +
          format(" at graph 0.98, first %.9g right offset 0,-0.65 font 'sans-serif,10' textcolor rgb '%s'\n",
                 chart.floor, kInk);
  return text;
}

std::string panel(const Chart& chart, const Page& page, std::size_t index) {
  const ChartPanel& shown = chart.panels[index];
  std::string data, plot;
  const std::string name = format("panel%d", int(index));
  data += block(name + "front", shown.front());
  plot = "plot $" + name + "front using 1:2 with lines lw 2 lc rgb '" + kFrontColor + "' notitle";
  for (std::size_t i = 0; i < shown.points.size(); ++i) {
    const std::string points = name + "p" + std::to_string(i);
    data += block(points, std::span(&shown.points[i], 1));
    plot += ", $" + points + " using 1:2" + points_style(shown.points[i].mark);
  }
  plot += ", $" + name + "front using 1:2 with points pt 6 ps 2.3 lw 1.6 lc rgb '" + kInk + "' notitle\n";
  return data + panel_axes(chart, page, index) + plot;
}

/// The legend: a plot of its own below the panels, in pixels.
class Legend {
 public:
  explicit Legend(const Page& page) : width_(page.legend_width()) {}

  void start_line(const char* what) {
    y_ -= 25.0;
    x_ = 0.0;
    texts_ += format("%.1f %.1f \"%s\"\n", x_, y_, what);
    x_ += 112.0;
  }
  void add(const ChartMark& mark) {
    add_point(mark);
    add_text(mark.name);
  }
  void add_front() {
    add_point({"", kInk, 6, ""});
    lines_ += format("%.1f %.1f\n%.1f %.1f\n", x_ - 30.0, y_, x_ - 2.0, y_);
    add_text("Pareto front: nothing is both faster and righter");
  }

  [[nodiscard]] std::string script(const Page& page) const {
    std::string text =
        "$legendtexts << END\n" + texts_ + "END\n$legendlines << END\n" + lines_ + "END\n" + data_;
    text += "unset title\nunset xlabel\nunset logscale\nunset tics\nunset border\nunset grid\n";
    text += "unset object 1\nunset arrow 1\nunset label 4\n" + page.legend_margins();
    text += format("set xrange [0:%.1f]\nset yrange [0:100]\n", width_);
    text += format("plot $legendlines using 1:2 with lines lw 2 lc rgb '%s' notitle", kFrontColor);
    return text + plot_ + format(", $legendtexts using 1:2:3 with labels left tc rgb '%s' notitle\n", kInk);
  }

 private:
  void add_point(const ChartMark& mark) {
    const std::string name = "legend" + std::to_string(count_++);
    x_ += 16.0;
    data_ += "$" + name + " << END\n" + format("%.1f %.1f\nEND\n", x_, y_);
    plot_ += ", $" + name + " using 1:2" + points_style(mark);
    x_ += 14.0;
  }
  void add_text(const std::string& text) {
    texts_ += format("%.1f %.1f \"%s\"\n", x_, y_, text.c_str());
    // About the width of the letters.
    x_ += 8.1 * double(text.size()) + 18.0;
  }

  double width_, x_ = 0.0, y_ = 112.0;
  int count_ = 0;
  std::string texts_, lines_, data_, plot_;
};

std::string legend(const Chart& chart, const Page& page) {
  Legend made(page);
  made.start_line("Colour:");
  for (const ChartMark& mark : chart.precisions) made.add(mark);
  made.start_line("Shape:");
  for (const ChartMark& mark : chart.structures) made.add(mark);
  made.start_line("Yardstick:");
  for (const ChartMark& mark : chart.yardsticks) made.add(mark);
  made.start_line("Ring:");
  made.add_front();
  return made.script(page);
}

}  // namespace

std::string gnuplot_script(const Chart& chart, PlotFormat format) {
  const Page page(chart.panels.size());
  std::string text = head(chart, page, format);
  for (std::size_t i = 0; i < chart.panels.size(); ++i) {
    text += panel(chart, page, i);
    // Titles of the page are drawn once.
    if (i == 0) text += "unset label 1\nunset label 2\nunset label 3\n";
  }
  return text + legend(chart, page) + "unset multiplot\n";
}

}  // namespace gridcast::server
