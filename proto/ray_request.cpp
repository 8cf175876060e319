#include "proto/ray_request.h"

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "proto/binary_rays.h"
#include "proto/json_reader.h"
#include "proto/media_type.h"
#include "proto/ray_columns.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

constexpr std::size_t kRowColumns = 8;  // ox oy oz tnear dx dy dz tfar
constexpr std::size_t kTnearColumn = 3;
constexpr std::size_t kDirectionColumn = 4;
constexpr std::size_t kTfarColumn = 7;

/// Those of rays/all come last, so that the others know a first part of them.
constexpr std::array<std::string_view, 12> kListMembers{"origins",     "directions", "tnear",    "tfar",
                                                        "exclude",     "precision",  "fields",   "stats",
                                                        "deadline_ms", "mask",       "max_hits", "after"};
constexpr std::array<std::string_view, 7> kListParameters{"precision", "fields",   "stats",   "deadline_ms",
                                                          "mask",      kAtVersion, "max_hits"};
std::span<const std::string_view> known_members(RayQuestion question) {
  const std::span all(kListMembers);
  return question == RayQuestion::kAll ? all : all.first(10);
}
std::span<const std::string_view> known_parameters(RayQuestion question) {
  const std::span all(kListParameters);
  return question == RayQuestion::kAll ? all : all.first(6);
}

/// Why a question is not answered in a precision; empty when it is.
std::string_view refusal(RayQuestion question, Precision precision) {
  if (question == RayQuestion::kCount && precision != Precision::kRobust)
    return "counts are decided as by robust, and no other way";
  if (question == RayQuestion::kAll && precision == Precision::kExact)
    return "hits are listed in fast and robust precision";
  return {};
}

void read_options(const ObjectReader& body, const Limits& limits, RayQuestion question, RayOptions& options) {
  read_ray_options(body, limits, options);
  if (const auto* node = question == RayQuestion::kAll ? body.find("max_hits") : nullptr)
    options.max_hits = std::uint32_t(read_integer(*node, 1, limits.hits_per_ray));
}

std::optional<Problem> apply_query(const QueryParameters& parameters, const Limits& limits,
                                   RayQuestion question, RayOptions& options) {
  QueryReader query(parameters, known_parameters(question));
  apply_ray_options(query, limits, options);
  if (query.find("max_hits") != nullptr)
    options.max_hits = std::uint32_t(query.integer("max_hits", 1, limits.hits_per_ray, 1));
  const std::string_view refused = refusal(question, options.precision);
  if (query.find("precision") != nullptr && !refused.empty())
    query.fail(ProblemCode::kInvalidValue, "precision", std::string(refused));
  return query.problem();
}

void read_scalar_column(const JsonNode& node, std::size_t column, std::vector<double>& rows) {
  const auto array = read_column(node, rows.size() / kRowColumns, "ray");
  if (!array) return;
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    // null keeps what the row starts with: 0 for tnear, unbounded for tfar.
    if (!element.is_null()) rows[kRowColumns * i + column] = read_number(node.child(element, i));
    if (node.problems->any()) return;
    ++i;
  }
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
  read_vector_column(*origins, "ray", kRowColumns, 0, request.rows);
  read_vector_column(*directions, "ray", kRowColumns, kDirectionColumn, request.rows);
  if (const auto* node = body.find("tnear")) read_scalar_column(*node, kTnearColumn, request.rows);
  if (const auto* node = body.find("tfar")) read_scalar_column(*node, kTfarColumn, request.rows);
  if (const auto* node = body.find("exclude"))
    read_entries(*node, "ray", count, request.excluded, read_primitive_ref);
  if (const auto* node = question == RayQuestion::kAll ? body.find("after") : nullptr)
    read_entries(*node, "ray", count, request.after, read_position);
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

std::optional<RayRequest> announced_rays(std::string_view content_type, std::size_t body_bytes,
                                         const QueryParameters& query, const Limits& limits,
                                         RayQuestion question) {
  const auto type = parse_media_type(content_type);
  if (!type || type->essence != kRaysMediaType) return std::nullopt;
  const std::string* exclude = type->find("exclude");
  RayRequest request;
  if ((exclude != nullptr && *exclude != "none") || check_binary_rays(*type, body_bytes, limits, request) ||
      apply_query(query, limits, question, request.options))
    return std::nullopt;
  return request;
}

}  // namespace gridcast::proto
