#include "proto/sensor_request.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "proto/geometry_reader.h"
#include "proto/json_reader.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

/// Those of every type come first; the others with the types that have them, by their initials.
struct Member {
  std::string_view name;
  std::string_view types;
};
constexpr std::string_view kEveryType = "pfolg";
constexpr std::array<Member, 20> kMembers{{{"type", kEveryType},
                                           {"pose", kEveryType},
                                           {"max_range", kEveryType},
                                           {"max_returns", kEveryType},
                                           {"noise", kEveryType},
                                           {"precision", kEveryType},
                                           {"fields", kEveryType},
                                           {"stats", kEveryType},
                                           {"deadline_ms", kEveryType},
                                           {"mask", kEveryType},
                                           {"width_px", "pfo"},
                                           {"height_px", "pfo"},
                                           {"yfov_deg", "p"},
                                           {"fov_deg", "f"},
                                           {"height", "o"},
                                           {"elevations_deg", "l"},
                                           {"azimuth", "l"},
                                           {"columns", "g"},
                                           {"rows", "g"},
                                           {"spacing", "g"}}};
constexpr double kUnbounded = std::numeric_limits<double>::max();
constexpr std::uint64_t kMostColumns = 1U << 20U;
/// Of an azimuth range that is a whole number of steps, rounding adds no step.
constexpr double kStepSlack = 1e-6;
/// The largest integer that every reader of JSON keeps.
constexpr std::uint64_t kLargestSeed = (std::uint64_t(1) << 53U) - 1;

std::vector<std::string_view> member_names() {
  std::vector<std::string_view> names;
  names.reserve(std::size(kMembers));
  for (const Member& member : kMembers) names.push_back(member.name);
  return names;
}

SensorPose read_pose(const JsonNode& node) {
  const ObjectReader pose(node, {"eye", "target", "up", "transform"});
  if (node.problems->any()) return LookAtPose{};
  if (const JsonNode* transform = pose.find("transform")) {
    for (const char* other : {"eye", "target", "up"})
      if (const JsonNode* extra = pose.find(other))
        extra->fail(ProblemCode::kInvalidValue, "a pose is a transform, or eye and target");
    return read_transform(*transform);
  }
  LookAtPose look;
  if (const JsonNode* eye = pose.require("eye")) look.eye = read_vec3(*eye);
  if (const JsonNode* target = pose.require("target")) look.target = read_vec3(*target);
  if (const JsonNode* up = pose.find("up")) look.up = read_vec3(*up);
  return look;
}

double read_above(const ObjectReader& object, std::string_view name, double low, double high,
                  double fallback) {
  const JsonNode* node = object.find(name);
  return node == nullptr ? fallback : read_number_above(*node, low, high);
}

std::uint32_t require_count(const ObjectReader& object, std::string_view name, std::uint64_t high) {
  const JsonNode* node = object.require(name);
  return node == nullptr ? 0 : std::uint32_t(read_integer(*node, 1, high));
}

/// A list, or {"from", "to", "count"}: evenly spaced with both ends.
std::vector<double> read_elevations(const JsonNode& node) {
  std::vector<double> elevations;
  if (node.value.is_object()) {
    const ObjectReader range(node, {"from", "to", "count"});
    const JsonNode* from = range.require("from");
    const JsonNode* to = range.require("to");
    const std::uint32_t count = require_count(range, "count", kMostColumns);
    if (from == nullptr || to == nullptr || node.problems->any()) return elevations;
    const double first = read_number(*from), last = read_number(*to);
    for (std::uint32_t i = 0; i < count; ++i)
      elevations.push_back(count == 1 ? first : first + (last - first) * (double(i) / double(count - 1)));
    return elevations;
  }
  const auto array = read_array(node);
  if (!array) return elevations;
  for (const simdjson::dom::element element : *array) {
    elevations.push_back(read_number(node.child(element, elevations.size())));
    if (node.problems->any()) break;
  }
  return elevations;
}

void read_azimuth(const JsonNode& node, SensorRequest& request) {
  const ObjectReader azimuth(node, {"from_deg", "to_deg", "step_deg"});
  const JsonNode* step = node.problems->any() ? nullptr : azimuth.require("step_deg");
  if (step == nullptr) return;
  if (const JsonNode* from = azimuth.find("from_deg")) request.azimuth_from_deg = read_number(*from);
  double to_deg = request.azimuth_from_deg + 360.0;
  if (const JsonNode* to = azimuth.find("to_deg")) to_deg = read_number(*to);
  request.azimuth_step_deg = read_number_above(*step, 0.0, kUnbounded);
  if (node.problems->any()) return;
  const double steps = std::ceil((to_deg - request.azimuth_from_deg) / request.azimuth_step_deg - kStepSlack);
  if (!(steps >= 1.0 && steps <= double(kMostColumns)))
    return step->fail(ProblemCode::kOutOfRange,
                      "to_deg must lie 1 to " + std::to_string(kMostColumns) + " steps beyond from_deg");
  request.azimuth_count = std::uint32_t(steps);
}

void read_spacing(const JsonNode& node, SensorRequest& request) {
  const auto array = read_array(node);
  if (!array) return;
  if (array->size() != 2) return node.fail(ProblemCode::kWrongLength, "must be [x, y] in metres");
  request.x_spacing = read_number_above(node.child(array->at(0).value_unsafe(), 0), 0.0, kUnbounded);
  request.y_spacing = read_number_above(node.child(array->at(1).value_unsafe(), 1), 0.0, kUnbounded);
}

void read_noise(const JsonNode& node, SensorRequest& request) {
  const ObjectReader noise(node, {"sigma", "seed"});
  const JsonNode* sigma = node.problems->any() ? nullptr : noise.require("sigma");
  if (sigma == nullptr) return;
  request.noise_sigma = read_number(*sigma);
  if (request.noise_sigma < 0.0) sigma->fail(ProblemCode::kOutOfRange, "must not be negative");
  if (const JsonNode* seed = noise.find("seed")) request.noise_seed = read_integer(*seed, 0, kLargestSeed);
}

/// The members that only some types have. Those that the type must have are required.
void read_model(const ObjectReader& body, const Limits& limits, SensorRequest& request) {
  const auto side = std::uint64_t(limits.image_side_px);
  if (request.type == "lidar") {
    if (const JsonNode* node = body.require("elevations_deg"))
      request.elevations_deg = read_elevations(*node);
    if (const JsonNode* node = body.require("azimuth")) read_azimuth(*node, request);
  } else if (request.type == "grid") {
    request.columns = require_count(body, "columns", kMostColumns);
    request.rows = require_count(body, "rows", kMostColumns);
    if (const JsonNode* node = body.find("spacing")) read_spacing(*node, request);
  } else {
    request.width_px = require_count(body, "width_px", side);
    request.height_px = require_count(body, "height_px", side);
    request.yfov_deg = read_above(body, "yfov_deg", 0.0, 180.0, request.yfov_deg);
    request.fov_deg = read_above(body, "fov_deg", 0.0, 360.0, request.fov_deg);
    request.height = read_above(body, "height", 0.0, kUnbounded, request.height);
  }
}

void refuse_members_of_others(const ObjectReader& body, const SensorRequest& request) {
  for (const Member& member : kMembers)
    if (member.types.find(request.type.front()) == std::string_view::npos)
      if (const JsonNode* node = body.find(member.name))
        node->fail(ProblemCode::kUnknownField, "is not a member of this type of sensor");
}

void read_sensor(const ObjectReader& body, const Limits& limits, SensorRequest& request) {
  const JsonNode* type = body.require("type");
  const JsonNode* pose = body.require("pose");
  if (type == nullptr || pose == nullptr) return;
  request.type = read_choice(*type, kSensorTypeNames);
  if (type->problems->any()) return;
  refuse_members_of_others(body, request);
  read_ray_options(body, limits, request.options);
  request.pose = read_pose(*pose);
  request.max_range = read_above(body, "max_range", 0.0, kUnbounded, request.max_range);
  if (const JsonNode* node = body.find("max_returns"))
    request.max_returns = std::uint32_t(read_integer(*node, 1, limits.hits_per_ray));
  if (const JsonNode* node = body.find("noise")) read_noise(*node, request);
  read_model(body, limits, request);
}

}  // namespace

Parsed<SensorRequest> parse_sensor_request(std::string_view text, const QueryParameters& parameters,
                                           const Limits& limits) {
  auto request = parse_body(text, limits, [&](const JsonNode& root) {
    SensorRequest read;
    const std::vector<std::string_view> names = member_names();
    const ObjectReader body(root, names);
    if (!root.problems->any()) read_sensor(body, limits, read);
    return read;
  });
  if (!request) return request;
  QueryReader query(parameters, {"precision", "fields", "stats", "deadline_ms", "mask", kAtVersion});
  apply_ray_options(query, limits, request->options);
  if (query.problem()) return *query.problem();
  if (request->noise_sigma > 0.0 && has(request->options.fields, HitField::kTError))
    return Problem{ProblemCode::kInvalidValue, "t_error bounds the t of a ray, not one with noise", "/noise"};
  return request;
}

}  // namespace gridcast::proto
