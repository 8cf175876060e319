#include "server/chart/chart_vega.h"

#include <algorithm>
#include <string>

#include "server/chart/tradeoff_json.h"

namespace gridcast::server {
namespace {

using Json = nlohmann::ordered_json;

Json values_of(const Chart& chart, const measure::TradeoffReport& report) {
  const Json rows = tradeoff_rows(report);
  Json values = Json::array();
  for (const ChartPanel& panel : chart.panels) {
    for (const ChartPoint& point : panel.points) {
      Json value = rows[point.row];
      value["panel"] = panel.title;
      value["method"] = point.mark.name;
      value["height"] = point.height;
      values.push_back(std::move(value));
    }
  }
  return values;
}

/// A scale that gives every method its colour or shape.
Json scale_of(const Chart& chart, std::string ChartMark::*what) {
  Json domain = Json::array(), range = Json::array();
  for (const ChartPanel& panel : chart.panels) {
    for (const ChartPoint& point : panel.points) {
      if (std::find(domain.begin(), domain.end(), Json(point.mark.name)) != domain.end()) continue;
      domain.push_back(point.mark.name);
      range.push_back(point.mark.*what);
    }
  }
  return {{"domain", domain}, {"range", range}};
}

Json x_of(const Chart& chart) {
  return {{"field", "mrays_per_s"},
          {"type", "quantitative"},
          {"title", chart.x_title},
          {"scale", {{"type", "log"}, {"domain", {chart.left, chart.right}}}}};
}

Json y_of(const Chart& chart, const char* field) {
  Json ticks = Json::array();
  for (const ChartTick& tick : chart.y_ticks) ticks.push_back(tick.at);
  return {{"field", field},
          {"type", "quantitative"},
          {"title", "errors per million rays"},
          {"axis", {{"values", ticks}, {"format", "~s"}}},
          {"scale", {{"type", "log"}, {"domain", {chart.top, chart.bottom}}, {"reverse", true}}}};
}

Json positions(const Chart& chart) {
  return {{"x", x_of(chart)}, {"y", y_of(chart, "height")}};
}

/// The band of those without an error, its floor and what it says: data of its own, drawn once a panel.
void add_band(Json& layers, const Chart& chart) {
  Json data{{"values", Json::array()}};
  data["values"].push_back({{"floor", chart.floor}, {"top", chart.top}, {"floor_text", chart.floor_text}});
  const Json floor = y_of(chart, "floor");
  layers.push_back({{"data", data},
                    {"mark", {{"type", "rect"}, {"color", "#eef3ee"}}},
                    {"encoding", {{"y", floor}, {"y2", {{"field", "top"}}}}}});
  layers.push_back(
      {{"data", data}, {"mark", {{"type", "rule"}, {"strokeDash", {4, 4}}}}, {"encoding", {{"y", floor}}}});
  layers.push_back(
      {{"data", data},
       {"mark",
        {{"type", "text"}, {"align", "left"}, {"baseline", "top"}, {"dx", 4}, {"dy", 4}, {"fontSize", 10}}},
       {"encoding", {{"x", {{"value", 0}}}, {"y", floor}, {"text", {{"field", "floor_text"}}}}}});
}

/// Colour or shape of the method. One legend for both, a column for each precision.
Json look(const Chart& chart, std::string ChartMark::*what) {
  return {{"field", "method"},
          {"type", "nominal"},
          {"title", nullptr},
          {"scale", scale_of(chart, what)},
          {"legend",
           {{"orient", "bottom"},
            {"columns", std::max<std::size_t>(chart.precisions.size(), 2)},
            {"labelLimit", 0},
            {"symbolSize", 80}}}};
}

Json points(const Chart& chart) {
  Json encoding = positions(chart);
  encoding["color"] = look(chart, &ChartMark::color);
  encoding["shape"] = look(chart, &ChartMark::vega_shape);
  encoding["tooltip"] = Json::array();
  for (const char* field : {"method", "mrays_per_s", "errors_per_million", "errors_below_per_million",
                            "missed_per_million", "false_per_million", "wrong_per_million",
                            "leaks_per_million", "t_error_ulp_p99", "bytes_per_triangle"})
    encoding["tooltip"].push_back({{"field", field}});
  return {{"mark", {{"type", "point"}, {"size", 60}, {"strokeWidth", 2}}}, {"encoding", encoding}};
}

Json layers(const Chart& chart) {
  const Json on_front = Json::array({{{"filter", "datum.pareto"}}});
  Json front = positions(chart);
  front["order"] = {{"field", "mrays_per_s"}};
  Json all = Json::array();
  add_band(all, chart);
  all.push_back(
      {{"transform", on_front}, {"mark", {{"type", "line"}, {"color", "#999999"}}}, {"encoding", front}});
  all.push_back(points(chart));
  all.push_back({{"transform", on_front},
                 {"mark", {{"type", "point"}, {"size", 220}, {"color", "#222222"}}},
                 {"encoding", positions(chart)}});
  return all;
}

}  // namespace

Json vega_chart(const Chart& chart, const measure::TradeoffReport& report) {
  Json order = Json::array();
  for (const ChartPanel& panel : chart.panels) order.push_back(panel.title);
  return {{"$schema", "https://vega.github.io/schema/vega-lite/v5.json"},
          {"background", "white"},
          {"title",
           {{"text", chart.title},
            {"anchor", "start"},
            {"offset", 12},
            {"subtitle",
             {chart.subtitle,
              "Right is faster, up is fewer errors (missed, false, wrong). Rings and line: the Pareto front, "
              "which nothing beats in both."}}}},
          {"data", {{"values", values_of(chart, report)}}},
          {"facet", {{"field", "panel"}, {"type", "nominal"}, {"title", nullptr}, {"sort", order}}},
          {"columns", 4},
          {"spec", {{"width", 250}, {"height", 220}, {"layer", layers(chart)}}}};
}

}  // namespace gridcast::server
