#include "proto/vertex_request.h"

#include <cmath>
#include <cstring>
#include <optional>

#include "proto/geometry_reader.h"
#include "proto/json_pointer.h"
#include "proto/json_reader.h"
#include "proto/media_type.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

std::optional<Problem> parse_json(std::string_view body, const Limits& limits, VertexRequest& request) {
  const auto document = JsonDocument::parse(body, limits.json_bytes, limits.json_depth);
  if (!document) return document.problem();
  JsonProblems problems;
  const ObjectReader object(document.value().root(problems), {"positions", "vertex_ids", "update"});
  const JsonNode* positions = problems.any() ? nullptr : object.require("positions");
  if (positions != nullptr) {
    read_positions(*positions, request.positions);
    if (request.positions.empty())
      positions->fail(ProblemCode::kWrongLength, "must have at least one position");
    if (const JsonNode* ids = object.find("vertex_ids"); ids != nullptr && !problems.any())
      read_vertex_ids(*ids, request.positions.size(), request.vertex_ids);
    if (const JsonNode* update = object.find("update"))
      request.update = read_choice(*update, kUpdateModeNames);
  }
  if (problems.any()) return problems.first();
  return std::nullopt;
}

/// Whether the positions follow as many ids; nothing for a parameter that is not known.
enum class Layout { kWhole, kSparse };
std::optional<Layout> read_layout(const MediaType& type) {
  Layout layout = Layout::kWhole;
  for (const auto& [name, value] : type.parameters) {
    if (name != "layout" || (value != "whole" && value != "sparse")) return std::nullopt;
    layout = value == "whole" ? Layout::kWhole : Layout::kSparse;
  }
  return layout;
}

std::optional<Problem> parse_binary(const MediaType& type, std::string_view body, const Limits& limits,
                                    VertexRequest& request) {
  const auto layout = read_layout(type);
  if (!layout)
    return Problem{ProblemCode::kUnsupportedMediaType,
                   std::string(kVerticesMediaType) + " takes layout=whole|sparse", "Content-Type"};
  if (body.size() > limits.binary_bytes)
    return Problem{ProblemCode::kPayloadTooLarge,
                   "binary vertices may have at most " + std::to_string(limits.binary_bytes) + " bytes", ""};
  const std::size_t id_bytes = *layout == Layout::kSparse ? sizeof(std::uint32_t) : 0;
  const std::size_t row_bytes = sizeof(Vec3f) + id_bytes;
  if (body.empty() || body.size() % row_bytes != 0)
    return Problem{ProblemCode::kWrongLength,
                   "the body is not a whole number of vertices of " + std::to_string(row_bytes) + " bytes",
                   ""};
  const std::size_t count = body.size() / row_bytes;
  request.vertex_ids.resize(id_bytes == 0 ? 0 : count);
  request.positions.resize(count);
  if (id_bytes != 0) std::memcpy(request.vertex_ids.data(), body.data(), count * id_bytes);
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  std::memcpy(request.positions.data(), body.data() + count * id_bytes, count * sizeof(Vec3f));
  for (std::size_t i = 0; i < count; ++i) {
    if (is_finite(request.positions[i])) continue;
    Problem problem{ProblemCode::kOutOfRange, std::string(kPositionNotFinite), "/positions"};
    append_pointer(problem.pointer, i);
    return problem;
  }
  return std::nullopt;
}

}  // namespace

Parsed<VertexRequest> parse_vertex_request(std::string_view content_type, std::string_view body,
                                           const QueryParameters& query, const Limits& limits) {
  const auto type = parse_media_type(content_type);
  VertexRequest request;
  std::optional<Problem> problem;
  if (type && type->essence == kJsonMediaType)
    problem = parse_json(body, limits, request);
  else if (type && type->essence == kVerticesMediaType)
    problem = parse_binary(*type, body, limits, request);
  else
    problem =
        Problem{ProblemCode::kUnsupportedMediaType,
                "vertices come as " + std::string(kJsonMediaType) + " or " + std::string(kVerticesMediaType),
                "Content-Type"};
  if (problem) return *problem;
  QueryReader reader(query, {"update"});
  request.update = reader.choice("update", kUpdateModeNames, request.update);
  if (reader.problem()) return *reader.problem();
  return request;
}

}  // namespace gridcast::proto
