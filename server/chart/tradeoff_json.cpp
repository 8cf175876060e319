#include "server/chart/tradeoff_json.h"

#include <cmath>

#include "core/math/precision_names.h"
#include "server/machine.h"

namespace gridcast::server {
namespace {

using Json = nlohmann::ordered_json;
using measure::Rate;

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json();
}

/// NAME_per_million, and NAME_below_per_million: null where something was seen, or nothing could be.
void add_rate(Json& row, const std::string& name, const Rate& rate) {
  row[name + "_per_million"] = rate.known() ? Json(rate.per_million()) : Json();
  row[name + "_below_per_million"] =
      rate.known() && rate.count == 0 ? Json(rate.below_per_million()) : Json();
}

void add_quantiles(Json& row, const std::string& name, const std::optional<measure::Quantiles>& found) {
  row[name + "_p50"] = found ? number(found->p50) : Json();
  row[name + "_p99"] = found ? number(found->p99) : Json();
  row[name + "_max"] = found ? number(found->max) : Json();
}

Json row_of(const measure::TradeoffRow& from) {
  const measure::Accuracy& accuracy = from.accuracy;
  Json row{{"engine", from.engine},         {"structure", from.structure},
           {"precision", from.precision},   {"ray_class", measure::to_string(from.ray_class)},
           {"entry", from.entry},           {"rays", accuracy.rays},
           {"timed_rays", from.timed_rays}, {"mrays_per_s", from.mrays_per_s},
           {"spread", from.spread},         {"bytes_per_triangle", from.bytes_per_triangle},
           {"build_s", from.build_s}};
  add_rate(row, "errors", accuracy.errors());
  add_rate(row, "missed", accuracy.missed);
  add_rate(row, "false", accuracy.false_hits);
  add_rate(row, "wrong", accuracy.wrong);
  add_rate(row, "leaks", accuracy.leaks);
  row["leaks_of"] = accuracy.leaks.known() ? Json(accuracy.leaks.of) : Json();
  add_rate(row, "ties", accuracy.ties);
  add_rate(row, "neighbours", accuracy.neighbours);
  add_quantiles(row, "t_error_ulp", accuracy.t_error_ulp);
  add_quantiles(row, "t_error_relative", accuracy.t_error_relative);
  row["bound_coverage"] = accuracy.covered.known() ? Json(accuracy.covered.share()) : Json();
  add_rate(row, "image_difference", from.image_difference);
  row["pareto"] = from.on_front;
  return row;
}

Json settings_of(const measure::TradeoffReport& report) {
  Json precisions = Json::array();
  for (const Precision precision : report.options.precisions) precisions.push_back(to_string(precision));
  return {{"accuracy_rays", report.options.accuracy_rays},
          {"speed_rays", report.options.speed_rays},
          {"repeat", report.options.repeat},
          {"threads", report.options.threads},
          {"seed", report.options.seed},
          {"precisions", precisions}};
}

void append_quoted(std::string& text, const std::string& value) {
  text.push_back('"');
  for (const char c : value) {
    if (c == '"') text.push_back('"');
    text.push_back(c);
  }
  text.push_back('"');
}

/// One line of the keys or of the values of a row.
template <class AppendField>
void append_line(std::string& text, const Json& row, const AppendField& append_field) {
  bool first = true;
  for (const auto& [key, value] : row.items()) {
    if (!first) text.push_back(',');
    first = false;
    append_field(key, value);
  }
  text.append("\r\n");
}

}  // namespace

Json tradeoff_rows(const measure::TradeoffReport& report) {
  Json rows = Json::array();
  for (const measure::TradeoffRow& row : report.rows) rows.push_back(row_of(row));
  return rows;
}

Json tradeoff_json(const measure::TradeoffReport& report, const std::string& name) {
  return {{"machine", machine_json()},
          {"scene",
           {{"name", name},
            {"stored_triangles", report.stored_triangles},
            {"world_triangles", report.world_triangles},
            {"instances", report.instances},
            {"meshes", report.meshes},
            {"closed_meshes", report.closed_meshes},
            {"diagonal_m", number(report.diagonal)}}},
          {"settings", settings_of(report)},
          {"notes", report.notes},
          {"rows", tradeoff_rows(report)}};
}

std::string tradeoff_csv(const measure::TradeoffReport& report) {
  std::string text;
  append_line(text, row_of({}), [&](const std::string& key, const Json&) { text.append(key); });
  for (const Json& row : tradeoff_rows(report)) {
    append_line(text, row, [&](const std::string&, const Json& value) {
      if (value.is_string())
        append_quoted(text, value.get<std::string>());
      else if (!value.is_null())
        text.append(value.dump());
    });
  }
  return text;
}

}  // namespace gridcast::server
