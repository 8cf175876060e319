#include "proto/ray_options.h"

#include "proto/field_names.h"
#include "proto/instance_mask.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
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
  if (const auto* node = body.find("fields"))
    options.fields = read_fields<HitField>(*node, kHitFieldNames, parse_hit_field);
  if (const auto* node = body.find("stats"))
    options.stats = read_flag(*node) ? StatsMode::kOn : StatsMode::kOff;
  if (const auto* node = body.find("deadline_ms"))
    options.deadline_ms = read_number_above(*node, 0.0, limits.deadline_ms);
  if (const auto* node = body.find("mask")) options.mask = read_query_mask(*node);
}

void apply_ray_options(QueryReader& query, const Limits& limits, RayOptions& options) {
  if (query.find("precision") != nullptr)
    options.precision = to_precision(query.choice("precision", kPrecisionNames, "robust"));
  options.fields = read_query_fields(query, kHitFieldNames, parse_hit_field, options.fields);
  if (const auto stats = query.flag("stats")) options.stats = *stats ? StatsMode::kOn : StatsMode::kOff;
  // The smallest deadline that means anything is a microsecond.
  if (const auto deadline = query.number("deadline_ms", 1e-3, limits.deadline_ms))
    options.deadline_ms = deadline;
  options.mask = query_mask(query, options.mask);
}

}  // namespace gridcast::proto
