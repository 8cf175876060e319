#include "server/chart_vega.h"

#include <algorithm>
#include <string>

#include "server/tradeoff_json.h"

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
      value["floor"] = chart.floor;
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

Json positions(const Chart& chart) {
  Json ticks = Json::array();
  for (const ChartTick& tick : chart.y_ticks) ticks.push_back(tick.at);
  return {{"x",
           {{"field", "mrays_per_s"},
            {"type", "quantitative"},
            {"title", chart.x_title},
            {"scale", {{"type", "log"}, {"domain", {chart.left, chart.right}}}}}},
          {"y",
           {{"field", "height"},
            {"type", "quantitative"},
            {"title", chart.y_title},
            {"axis", {{"values", ticks}, {"format", "~s"}}},
            {"scale", {{"type", "log"}, {"domain", {chart.top, chart.bottom}}, {"reverse", true}}}}}};
}

Json layers(const Chart& chart) {
  Json points = positions(chart);
  points["color"] = {{"field", "method"},
                     {"type", "nominal"},
                     {"title", nullptr},
                     {"scale", scale_of(chart, &ChartMark::color)}};
  points["shape"] = {{"field", "method"},
                     {"type", "nominal"},
                     {"title", nullptr},
                     {"scale", scale_of(chart, &ChartMark::vega_shape)}};
  points["tooltip"] = Json::array();
  for (const char* field : {"method", "mrays_per_s", "errors_per_million", "errors_below_per_million",
                            "missed_per_million", "false_per_million", "wrong_per_million",
                            "leaks_per_million", "t_error_ulp_p99", "bytes_per_triangle"})
    points["tooltip"].push_back({{"field", field}});
  Json front = positions(chart);
  front["order"] = {{"field", "mrays_per_s"}};
  const Json on_front = Json::array({{{"filter", "datum.pareto"}}});
  return Json::array(
      {{{"mark", {{"type", "rule"}, {"strokeDash", {4, 4}}}},
        {"encoding", {{"y", {{"field", "floor"}, {"type", "quantitative"}, {"aggregate", "min"}}}}}},
       {{"transform", on_front}, {"mark", {{"type", "line"}, {"color", "#999999"}}}, {"encoding", front}},
       {{"mark", {{"type", "point"}, {"size", 60}, {"strokeWidth", 2}}}, {"encoding", points}},
       {{"transform", on_front},
        {"mark", {{"type", "point"}, {"size", 220}, {"color", "#222222"}}},
        {"encoding", positions(chart)}}});
}

}  // namespace

Json vega_chart(const Chart& chart, const measure::TradeoffReport& report) {
  Json order = Json::array();
  for (const ChartPanel& panel : chart.panels) order.push_back(panel.title);
  Json yardsticks = Json::array();
  for (const ChartMark& mark : chart.yardsticks) yardsticks.push_back(mark.name);
  return {{"$schema", "https://vega.github.io/schema/vega-lite/v5.json"},
          {"title", {{"text", chart.title}, {"subtitle", {chart.subtitle, "Dashed: " + chart.floor_text}}}},
          {"usermeta", {{"yardsticks", yardsticks}}},
          {"data", {{"values", values_of(chart, report)}}},
          {"facet", {{"field", "panel"}, {"type", "nominal"}, {"title", nullptr}, {"sort", order}}},
          {"columns", 4},
          {"spec", {{"width", 250}, {"height", 220}, {"layer", layers(chart)}}}};
}

}  // namespace gridcast::server
