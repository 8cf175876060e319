#include "proto/point_request.h"

#include <array>
#include <string>

#include "proto/binary_rows.h"
#include "proto/field_names.h"
#include "proto/instance_mask.h"
#include "proto/json_reader.h"
#include "proto/media_type.h"

namespace gridcast::proto {
namespace {

/// That of points/closest comes last.
constexpr std::array<std::string_view, 5> kMembers{"points", "deadline_ms", "fields", "mask", "max_distance"};
constexpr std::array<std::string_view, 5> kParameters{"deadline_ms", "fields", "mask", kAtVersion,
                                                      "max_distance"};

/// The columns that answers to a question have, by name.
struct FieldNames {
  std::span<const std::string_view> names;
  std::optional<PointField> (*parse)(std::string_view name);
};
FieldNames field_names(PointQuestion question) {
  if (question == PointQuestion::kClosest) return {kNearestFieldNames, parse_nearest_field};
  return {kInsideFieldNames, parse_inside_field};
}

void read_points(const JsonNode& node, const Limits& limits, std::vector<double>& rows) {
  const auto array = read_array(node);
  if (!array) return;
  if (array->size() > limits.json_rays)
    return node.fail(ProblemCode::kTooManyPoints,
                     "a JSON body may have at most " + std::to_string(limits.json_rays) +
                         " points; send more as " + std::string(kPointsMediaType));
  rows.reserve(3 * array->size());
  std::size_t i = 0;
  for (const simdjson::dom::element element : *array) {
    const Vec3d point = read_vec3(node.child(element, i++));
    if (node.problems->any()) return;
    rows.insert(rows.end(), {point.x, point.y, point.z});
  }
}

std::optional<Problem> parse_json(std::string_view body, const Limits& limits, PointQuestion question,
                                  PointRequest& request) {
  const auto document = JsonDocument::parse(body, limits.json_bytes, limits.json_depth);
  if (!document) return document.problem();
  JsonProblems problems;
  const ObjectReader object(document.value().root(problems),
                            std::span(kMembers).first(question == PointQuestion::kClosest ? 5 : 4));
  const FieldNames columns = field_names(question);
  if (const auto* node = problems.any() ? nullptr : object.find("fields"))
    request.fields = read_fields<PointField>(*node, columns.names, columns.parse);
  if (const auto* node = problems.any() ? nullptr : object.find("deadline_ms"))
    request.deadline_ms = read_number_above(*node, 0.0, limits.deadline_ms);
  if (const auto* node = problems.any() ? nullptr : object.find("mask"))
    request.mask = read_query_mask(*node);
  if (question == PointQuestion::kClosest && !problems.any()) {
    const auto* node = object.find("max_distance");
    if (node != nullptr && !node->value.is_null()) {
      request.max_distance = read_number(*node);
      if (request.max_distance < 0.0) node->fail(ProblemCode::kOutOfRange, "must not be negative");
    }
  }
  if (const auto* node = problems.any() ? nullptr : object.require("points"))
    read_points(*node, limits, request.rows);
  if (problems.any()) return problems.first();
  return std::nullopt;
}

std::optional<Problem> apply_query(const QueryParameters& parameters, const Limits& limits,
                                   PointQuestion question, PointRequest& request) {
  QueryReader query(parameters, std::span(kParameters).first(question == PointQuestion::kClosest ? 5 : 4));
  const FieldNames columns = field_names(question);
  request.fields = read_query_fields(query, columns.names, columns.parse, request.fields);
  if (const auto distance = query.number("max_distance", 0.0, std::numeric_limits<double>::max()))
    request.max_distance = *distance;
  // The smallest deadline that means anything is a microsecond.
  if (const auto deadline = query.number("deadline_ms", 1e-3, limits.deadline_ms))
    request.deadline_ms = deadline;
  request.mask = query_mask(query, request.mask);
  return query.problem();
}

}  // namespace

std::optional<PointField> parse_nearest_field(std::string_view name) {
  if (name == "status" || name == "distance") return PointField::kNone;
  if (name == "position") return PointField::kPosition;
  if (name == "uv") return PointField::kUv;
  if (name == "instance_id") return PointField::kInstanceId;
  if (name == "mesh_id") return PointField::kMeshId;
  if (name == "primitive_id") return PointField::kPrimitiveId;
  return std::nullopt;
}

std::optional<PointField> parse_inside_field(std::string_view name) {
  if (name == "place") return PointField::kNone;
  if (name == "splits") return PointField::kSplits;
  if (name == "instance_id") return PointField::kSplits | PointField::kInstanceId;
  if (name == "mesh_id") return PointField::kSplits | PointField::kMeshId;
  if (name == "winding") return PointField::kSplits | PointField::kWinding;
  if (name == "on_boundary") return PointField::kSplits | PointField::kOnBoundary;
  if (name == "open_meshes") return PointField::kOpenMeshes;
  return std::nullopt;
}

PointBatch PointRequest::batch() const {
  if (!binary_body.empty()) return {binary_body, scalar};
  return {std::as_bytes(std::span(rows)), ScalarType::kFloat64};
}

Parsed<PointRequest> parse_point_request(std::string_view content_type, std::string_view body,
                                         const QueryParameters& query, const Limits& limits,
                                         PointQuestion question) {
  const auto type = parse_media_type(content_type);
  PointRequest request;
  std::optional<Problem> problem;
  if (type && type->essence == kJsonMediaType)
    problem = parse_json(body, limits, question, request);
  else if (type && type->essence == kPointsMediaType)
    problem = read_binary_rows({kPointsMediaType, "points", 3}, *type, body, limits, request.scalar,
                               request.binary_body);
  else
    problem =
        Problem{ProblemCode::kUnsupportedMediaType,
                "points come as " + std::string(kJsonMediaType) + " or " + std::string(kPointsMediaType),
                "Content-Type"};
  if (!problem) problem = apply_query(query, limits, question, request);
  if (problem) return *problem;
  return request;
}

}  // namespace gridcast::proto
