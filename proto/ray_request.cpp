#include "proto/ray_request.h"

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "proto/binary_rays.h"
#include "proto/json_reader.h"
#include "proto/media_type.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

constexpr std::size_t kRowColumns = 8;  // ox oy oz tnear dx dy dz tfar
constexpr std::size_t kTnearColumn = 3;
constexpr std::size_t kDirectionColumn = 4;
constexpr std::size_t kTfarColumn = 7;

/// Those of rays/all come last, so that the others know a first part of them.
constexpr std::array<std::string_view, 11> kListMembers{"origins",     "directions", "tnear",  "tfar",
                                                        "exclude",     "precision",  "fields", "stats",
                                                        "deadline_ms", "max_hits",   "after"};
constexpr std::array<std::string_view, 5> kListParameters{"precision", "fields", "stats", "deadline_ms",
                                                          "max_hits"};
std::span<const std::string_view> known_members(RayQuestion question) {
  const std::span all(kListMembers);
  return question == RayQuestion::kAll ? all : all.first(9);
}
std::span<const std::string_view> known_parameters(RayQuestion question) {
  const std::span all(kListParameters);
  return question == RayQuestion::kAll ? all : all.first(4);
}

/// Why a question is not answered in a precision; empty when it is.
std::string_view refusal(RayQuestion question, Precision precision) {
  if (question == RayQuestion::kCount && precision != Precision::kRobust)
    return "counts are decided as by robust, and no other way";
  if (question == RayQuestion::kAll && precision == Precision::kExact)
    return "hits are listed in fast and robust precision";
  return {};
}

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

void read_options(const ObjectReader& body, const Limits& limits, RayQuestion question, RayOptions& options) {
  if (const auto* node = body.find("precision"))
    options.precision = to_precision(read_choice(*node, kPrecisionNames));
  if (const auto* node = body.find("fields")) options.fields = read_fields(*node);
  if (const auto* node = body.find("stats"))
    options.stats = read_flag(*node) ? StatsMode::kOn : StatsMode::kOff;
  if (const auto* node = body.find("deadline_ms"))
    options.deadline_ms = read_number_above(*node, 0.0, limits.deadline_ms);
  if (const auto* node = question == RayQuestion::kAll ? body.find("max_hits") : nullptr)
    options.max_hits = std::uint32_t(read_integer(*node, 1, limits.hits_per_ray));
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

std::optional<Problem> apply_query(const QueryParameters& parameters, const Limits& limits,
                                   RayQuestion question, RayOptions& options) {
  QueryReader query(parameters, known_parameters(question));
  if (query.find("precision") != nullptr)
    options.precision = to_precision(query.choice("precision", kPrecisionNames, "robust"));
  options.fields = read_query_fields(query, options.fields);
  if (const auto stats = query.flag("stats")) options.stats = *stats ? StatsMode::kOn : StatsMode::kOff;
  // The smallest deadline that means anything is a microsecond.
  if (const auto deadline = query.number("deadline_ms", 1e-3, limits.deadline_ms))
    options.deadline_ms = deadline;
  if (query.find("max_hits") != nullptr)
    options.max_hits = std::uint32_t(query.integer("max_hits", 1, limits.hits_per_ray, 1));
  const std::string_view refused = refusal(question, options.precision);
  if (query.find("precision") != nullptr && !refused.empty())
    query.fail(ProblemCode::kInvalidValue, "precision", std::string(refused));
  return query.problem();
}

/// Checks that a column is an array of `count` values.
std::optional<simdjson::dom::array> read_column(const JsonNode& node, std::size_t count) {
  const auto array = read_array(node);
  if (!array || array->size() == count) return array;
  node.fail(ProblemCode::kWrongLength, "must have one entry per ray, " + std::to_string(count));
  return std::nullopt;
}

void read_vector_column(const JsonNode& node, std::size_t first_column, std::vector<double>& rows) {
  const auto array = read_column(node, rows.size() / kRowColumns);
  if (!array) return;
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    const Vec3d vector = read_vec3(node.child(element, i));
    if (node.problems->any()) return;
    double* row = rows.data() + kRowColumns * i++ + first_column;
    row[0] = vector.x;
    row[1] = vector.y;
    row[2] = vector.z;
  }
}

void read_scalar_column(const JsonNode& node, std::size_t column, std::vector<double>& rows) {
  const auto array = read_column(node, rows.size() / kRowColumns);
  if (!array) return;
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    // null keeps what the row starts with: 0 for tnear, unbounded for tfar.
    if (!element.is_null()) rows[kRowColumns * i + column] = read_number(node.child(element, i));
    if (node.problems->any()) return;
    ++i;
  }
}

PrimitiveRef read_primitive_ref(const JsonNode& node) {
  PrimitiveRef ref;
  const auto array = read_array(node);
  if (!array) return ref;
  if (array->size() != 2) {
    node.fail(ProblemCode::kWrongLength, "must be [instance_id, primitive_id]");
    return ref;
  }
  ref.instance_id = read_id(node.child(array->at(0).value_unsafe(), 0));
  ref.primitive_id = read_id(node.child(array->at(1).value_unsafe(), 1));
  return ref;
}

HitPosition read_position(const JsonNode& node) {
  HitPosition position;
  const auto array = read_array(node);
  if (!array) return position;
  if (array->size() != 3) {
    node.fail(ProblemCode::kWrongLength, "must be [t, instance_id, primitive_id]");
    return position;
  }
  position.t = read_number(node.child(array->at(0).value_unsafe(), 0));
  position.instance_id = read_id(node.child(array->at(1).value_unsafe(), 1));
  position.primitive_id = read_id(node.child(array->at(2).value_unsafe(), 2));
  return position;
}

/// One entry a ray, read by `read`; null keeps the default.
template <class T>
void read_entries(const JsonNode& node, std::size_t count, std::vector<T>& entries,
                  T (*read)(const JsonNode&)) {
  const auto array = read_column(node, count);
  if (!array) return;
  entries.resize(count);
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    if (!element.is_null()) entries[i] = read(node.child(element, i));
    if (node.problems->any()) return;
    ++i;
  }
}

void read_rays(const ObjectReader& body, const Limits& limits, RayQuestion question, RayRequest& request) {
  const JsonNode* origins = body.require("origins");
  const JsonNode* directions = body.require("directions");
  if (origins == nullptr || directions == nullptr) return;
  const auto array = read_array(*origins);
  if (!array) return;
  const std::size_t count = array->size();
  if (count > limits.json_rays) {
    return origins->fail(ProblemCode::kTooManyRays, "a JSON body may have at most " +
                                                        std::to_string(limits.json_rays) +
                                                        " rays; send more as " + std::string(kRaysMediaType));
  }
  request.rows.assign(count * kRowColumns, 0.0);
  for (std::size_t i = 0; i < count; ++i)
    request.rows[kRowColumns * i + kTfarColumn] = std::numeric_limits<double>::infinity();
  read_vector_column(*origins, 0, request.rows);
  read_vector_column(*directions, kDirectionColumn, request.rows);
  if (const auto* node = body.find("tnear")) read_scalar_column(*node, kTnearColumn, request.rows);
  if (const auto* node = body.find("tfar")) read_scalar_column(*node, kTfarColumn, request.rows);
  if (const auto* node = body.find("exclude"))
    read_entries(*node, count, request.excluded, read_primitive_ref);
  if (const auto* node = question == RayQuestion::kAll ? body.find("after") : nullptr)
    read_entries(*node, count, request.after, read_position);
}

std::optional<Problem> parse_json(std::string_view body, const Limits& limits, RayQuestion question,
                                  RayRequest& request) {
  const auto document = JsonDocument::parse(body, limits.json_bytes, limits.json_depth);
  if (!document) return document.problem();
  JsonProblems problems;
  const ObjectReader object(document.value().root(problems), known_members(question));
  if (!problems.any()) read_options(object, limits, question, request.options);
  if (const std::string_view refused = refusal(question, request.options.precision); !refused.empty())
    problems.add(ProblemCode::kInvalidValue, "/precision", std::string(refused));
  if (!problems.any()) read_rays(object, limits, question, request);
  if (problems.any()) return problems.first();
  return std::nullopt;
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

RayBatch RayRequest::batch() const {
  if (!binary_body.empty()) return {binary_body, scalar, columns, excluded};
  return {std::as_bytes(std::span(rows)), ScalarType::kFloat64, kRowColumns, excluded};
}

Parsed<RayRequest> parse_ray_request(std::string_view content_type, std::string_view body,
                                     const QueryParameters& query, const Limits& limits,
                                     RayQuestion question) {
  const auto type = parse_media_type(content_type);
  RayRequest request;
  std::optional<Problem> problem;
  if (type && type->essence == kJsonMediaType)
    problem = parse_json(body, limits, question, request);
  else if (type && type->essence == kRaysMediaType)
    problem = parse_binary_rays(*type, body, limits, request);
  else
    problem = Problem{ProblemCode::kUnsupportedMediaType,
                      "rays come as " + std::string(kJsonMediaType) + " or " + std::string(kRaysMediaType),
                      "Content-Type"};
  if (!problem) problem = apply_query(query, limits, question, request.options);
  if (problem) return *problem;
  return request;
}

}  // namespace gridcast::proto
