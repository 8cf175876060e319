#include "proto/explain_request.h"

#include <algorithm>

#include "proto/instance_mask.h"
#include "proto/json_reader.h"
#include "proto/ray_columns.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

void read_ray(const ObjectReader& body, ExplainRequest& request) {
  Ray& ray = request.ray;
  const JsonNode* origin = body.require("origin");
  const JsonNode* direction = body.require("direction");
  if (origin == nullptr || direction == nullptr) return;
  ray.origin = read_vec3(*origin);
  ray.direction = read_vec3(*direction);
  if (const auto* node = body.find("tnear"); node != nullptr && !node->value.is_null())
    ray.tnear = read_number(*node);
  if (const auto* node = body.find("tfar"); node != nullptr && !node->value.is_null())
    ray.tfar = read_number(*node);
  if (const auto* node = body.find("exclude"); node != nullptr && !node->value.is_null())
    request.excluded = read_primitive_ref(*node);
  if (max_abs(ray.origin) > kMaxRayOrigin)
    origin->fail(ProblemCode::kOutOfRange, "must have coordinates of at most 2^100");
  if (const double length = max_abs(ray.direction); length < kMinRayDirection || length > kMaxRayDirection)
    direction->fail(ProblemCode::kOutOfRange, "must have a largest component of 2^-200 to 2^200");
}

void read_options(const ObjectReader& body, const Limits& limits, ExplainRequest& request) {
  if (const auto* node = body.find("precision"))
    request.precision = to_precision(read_choice(*node, kPrecisionNames));
  if (const auto* node = body.find("max_steps"))
    request.max_steps = std::size_t(read_integer(*node, 1, limits.explain_steps));
  if (const auto* node = body.find("mask")) request.mask = read_query_mask(*node);
  if (const auto* node = body.find("deadline_ms"))
    request.deadline_ms = read_number_above(*node, 0.0, limits.deadline_ms);
}

std::optional<Problem> apply_query(const QueryParameters& parameters, const Limits& limits,
                                   ExplainRequest& request) {
  QueryReader query(parameters, {"precision", "max_steps", "deadline_ms", "mask", kAtVersion});
  if (query.find("precision") != nullptr)
    request.precision = to_precision(query.choice("precision", kPrecisionNames, "robust"));
  request.max_steps = std::size_t(query.integer("max_steps", 1, limits.explain_steps, request.max_steps));
  request.mask = query_mask(query, request.mask);
  // The smallest deadline that means anything is a microsecond.
  if (const auto deadline = query.number("deadline_ms", 1e-3, limits.deadline_ms))
    request.deadline_ms = deadline;
  return query.problem();
}

}  // namespace

Parsed<ExplainRequest> parse_explain_request(std::string_view body, const QueryParameters& query,
                                             const Limits& limits) {
  const auto document = JsonDocument::parse(body, limits.json_bytes, limits.json_depth);
  if (!document) return document.problem();
  ExplainRequest request;
  request.max_steps = std::min(kDefaultExplainSteps, std::size_t(limits.explain_steps));
  JsonProblems problems;
  const ObjectReader object(
      document.value().root(problems),
      {"origin", "direction", "tnear", "tfar", "exclude", "precision", "max_steps", "deadline_ms", "mask"});
  if (!problems.any()) read_options(object, limits, request);
  if (!problems.any()) read_ray(object, request);
  if (problems.any()) return problems.first();
  if (auto problem = apply_query(query, limits, request)) return *std::move(problem);
  return request;
}

}  // namespace gridcast::proto
