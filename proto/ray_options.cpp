#include "proto/ray_options.h"

#include <algorithm>

#include "proto/instance_mask.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

HitField read_fields(const JsonNode& node) {
  HitField fields{};
  const auto array = read_array(node);
  if (!array) return fields;
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    const JsonNode name = node.child(element, i++);
    fields = fields | parse_hit_field(read_choice(name, kHitFieldNames)).value_or(HitField{});
    if (node.problems->any()) break;
  }
  return fields;
}

/// fields=uv,normal
HitField read_query_fields(QueryReader& query, HitField fallback) {
  const std::string* list = query.find("fields");
  if (list == nullptr) return fallback;
  HitField fields{};
  std::string_view rest = *list;
  while (!rest.empty()) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    const auto field = parse_hit_field(rest.substr(0, comma));
    if (!field) query.fail(ProblemCode::kInvalidValue, "fields", list_choices(kHitFieldNames));
    fields = fields | field.value_or(HitField{});
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  return fields;
}

}  // namespace

std::optional<HitField> parse_hit_field(std::string_view name) {
  if (name == "status" || name == "t") return HitField(0);
  if (name == "uv") return HitField::kUv;
  if (name == "normal") return HitField::kNormal;
  if (name == "instance_id") return HitField::kInstanceId;
  if (name == "mesh_id") return HitField::kMeshId;
  if (name == "primitive_id") return HitField::kPrimitiveId;
  if (name == "t_error") return HitField::kTError;
  return std::nullopt;
}

void read_ray_options(const ObjectReader& body, const Limits& limits, RayOptions& options) {
  if (const auto* node = body.find("precision"))
    options.precision = to_precision(read_choice(*node, kPrecisionNames));
  if (const auto* node = body.find("fields")) options.fields = read_fields(*node);
  if (const auto* node = body.find("stats"))
    options.stats = read_flag(*node) ? StatsMode::kOn : StatsMode::kOff;
  if (const auto* node = body.find("deadline_ms"))
    options.deadline_ms = read_number_above(*node, 0.0, limits.deadline_ms);
  if (const auto* node = body.find("mask")) options.mask = read_query_mask(*node);
}

void apply_ray_options(QueryReader& query, const Limits& limits, RayOptions& options) {
  if (query.find("precision") != nullptr)
    options.precision = to_precision(query.choice("precision", kPrecisionNames, "robust"));
  options.fields = read_query_fields(query, options.fields);
  if (const auto stats = query.flag("stats")) options.stats = *stats ? StatsMode::kOn : StatsMode::kOff;
  // The smallest deadline that means anything is a microsecond.
  if (const auto deadline = query.number("deadline_ms", 1e-3, limits.deadline_ms))
    options.deadline_ms = deadline;
  options.mask = query_mask(query, options.mask);
}

}  // namespace gridcast::proto
