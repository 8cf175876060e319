#include "proto/visibility_request.h"

#include <limits>
#include <optional>
#include <string>

#include "proto/binary_rows.h"
#include "proto/json_reader.h"
#include "proto/media_type.h"
#include "proto/ray_columns.h"

namespace gridcast::proto {
namespace {

constexpr std::size_t kRowColumns = 6;  // from, to

BlockerMode blocker_mode(bool wanted) {
  return wanted ? BlockerMode::kFirst : BlockerMode::kNone;
}

void read_pairs(const ObjectReader& body, const Limits& limits, VisibilityRequest& request) {
  const JsonNode* from = body.require("from");
  const JsonNode* to = body.require("to");
  if (from == nullptr || to == nullptr) return;
  const auto array = read_array(*from);
  if (!array) return;
  const std::size_t count = array->size();
  if (count > limits.json_rays)
    return from->fail(ProblemCode::kTooManyPoints,
                      "a JSON body may have at most " + std::to_string(limits.json_rays) +
                          " pairs; send more as " + std::string(kPairsMediaType));
  request.rows.assign(count * kRowColumns, 0.0);
  read_vector_column(*from, "pair", kRowColumns, 0, request.rows);
  read_vector_column(*to, "pair", kRowColumns, 3, request.rows);
  if (const auto* node = body.find("exclude"))
    read_entries(*node, "pair", count, request.excluded, read_primitive_ref);
  if (const auto* node = body.find("target"))
    read_entries(*node, "pair", count, request.targets, read_primitive_ref);
}

std::optional<Problem> parse_json(std::string_view text, const Limits& limits, VisibilityRequest& request) {
  const auto document = JsonDocument::parse(text, limits.json_bytes, limits.json_depth);
  if (!document) return document.problem();
  JsonProblems problems;
  const ObjectReader body(document.value().root(problems),
                          {"from", "to", "exclude", "target", "margin", "blocker", "precision", "fields",
                           "stats", "deadline_ms", "mask"});
  if (!problems.any()) read_ray_options(body, limits, request.options);
  if (const auto* node = problems.any() ? nullptr : body.find("margin")) {
    request.margin = read_number(*node);
    if (request.margin < 0.0) node->fail(ProblemCode::kOutOfRange, "must not be negative");
  }
  if (const auto* node = problems.any() ? nullptr : body.find("blocker"))
    request.blocker = blocker_mode(read_flag(*node));
  if (!problems.any()) read_pairs(body, limits, request);
  if (problems.any()) return problems.first();
  return std::nullopt;
}

std::optional<Problem> apply_query(const QueryParameters& parameters, const Limits& limits,
                                   VisibilityRequest& request) {
  QueryReader query(parameters,
                    {"margin", "blocker", "precision", "fields", "stats", "deadline_ms", "mask", kAtVersion});
  apply_ray_options(query, limits, request.options);
  if (const auto margin = query.number("margin", 0.0, std::numeric_limits<double>::max()))
    request.margin = *margin;
  if (const auto wanted = query.flag("blocker")) request.blocker = blocker_mode(*wanted);
  return query.problem();
}

}  // namespace

PairBatch VisibilityRequest::batch() const {
  if (!binary_body.empty()) return {binary_body, scalar, excluded, targets};
  return {std::as_bytes(std::span(rows)), ScalarType::kFloat64, excluded, targets};
}

Parsed<VisibilityRequest> parse_visibility_request(std::string_view content_type, std::string_view body,
                                                   const QueryParameters& query, const Limits& limits) {
  const auto type = parse_media_type(content_type);
  VisibilityRequest request;
  std::optional<Problem> problem;
  if (type && type->essence == kJsonMediaType)
    problem = parse_json(body, limits, request);
  else if (type && type->essence == kPairsMediaType)
    problem = read_binary_rows({kPairsMediaType, "pairs", kRowColumns}, *type, body, limits, request.scalar,
                               request.binary_body);
  else
    problem = Problem{ProblemCode::kUnsupportedMediaType,
                      "pairs come as " + std::string(kJsonMediaType) + " or " + std::string(kPairsMediaType),
                      "Content-Type"};
  if (!problem) problem = apply_query(query, limits, request);
  if (problem) return *problem;
  return request;
}

}  // namespace gridcast::proto
