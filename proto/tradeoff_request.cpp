#include "proto/tradeoff_request.h"

#include <algorithm>
#include <span>

#include "proto/json_reader.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

// JSON numbers of many writers end here.
constexpr std::uint64_t kGreatestSeed = (std::uint64_t(1) << 53) - 1;
constexpr std::size_t kEmbreeModes = 2;  // default and robust, in every measurement

std::vector<std::string> read_choices(const JsonNode& node, std::span<const std::string_view> names) {
  std::vector<std::string> chosen;
  const auto array = read_array(node);
  if (!array) return chosen;
  for (const simdjson::dom::element element : *array) {
    const JsonNode child = node.child(element, chosen.size());
    const std::string name = read_choice(child, names);
    if (std::find(chosen.begin(), chosen.end(), name) != chosen.end())
      child.fail(ProblemCode::kDuplicateId, "this is named twice");
    if (node.problems->any()) return chosen;
    chosen.push_back(name);
  }
  if (chosen.empty())
    node.fail(ProblemCode::kWrongLength, "must name at least one of " + list_choices(names));
  return chosen;
}

/// All of `names` when the member is absent.
std::vector<std::string> read_choices_or_all(const ObjectReader& object, std::string_view member,
                                             std::span<const std::string_view> names) {
  if (const JsonNode* node = object.find(member)) return read_choices(*node, names);
  return {names.begin(), names.end()};
}

std::size_t read_count(const ObjectReader& object, std::string_view name, std::size_t high,
                       std::size_t fallback) {
  const JsonNode* node = object.find(name);
  return node == nullptr ? fallback : std::size_t(read_integer(*node, 1, high));
}

TradeoffRequest read_members(const ObjectReader& object, std::size_t max_threads, const Limits& limits) {
  TradeoffRequest request;
  request.ray_classes = read_choices_or_all(object, "ray_classes", kRayClassNames);
  if (const JsonNode* node = object.find("structures"))
    request.structures = read_choices(*node, kBuiltStructureNames);
  for (const std::string& name : read_choices_or_all(object, "precisions", kPrecisionNames))
    request.precisions.push_back(to_precision(name));
  request.accuracy_rays =
      read_count(object, "accuracy_rays", limits.tradeoff_accuracy_rays, request.accuracy_rays);
  request.speed_rays = read_count(object, "speed_rays", limits.tradeoff_speed_rays, request.speed_rays);
  request.repeat = read_count(object, "repeat", limits.tradeoff_repeat, request.repeat);
  request.threads = read_count(object, "threads", max_threads, request.threads);
  if (const JsonNode* node = object.find("seed")) request.seed = read_integer(*node, 0, kGreatestSeed);
  if (const JsonNode* node = object.find("deadline_ms"))
    request.deadline_ms = read_number_above(*node, 0.0, limits.job_deadline_ms);
  return request;
}

}  // namespace

std::uint64_t traces(const TradeoffRequest& request) {
  const std::size_t structures =
      request.structures.empty() ? kBuiltStructureNames.size() : request.structures.size();
  const std::size_t methods = structures * request.precisions.size() + kEmbreeModes;
  const std::uint64_t per_method =
      request.accuracy_rays + std::uint64_t(request.repeat + 1) * request.speed_rays;
  return request.ray_classes.size() * methods * per_method;
}

Parsed<TradeoffRequest> parse_tradeoff_request(std::string_view body, std::size_t max_threads,
                                               const Limits& limits) {
  const auto document = JsonDocument::parse(body, limits.json_bytes, limits.json_depth);
  if (!document) return document.problem();
  JsonProblems problems;
  const JsonNode root = document.value().root(problems);
  const ObjectReader object(root, {"ray_classes", "structures", "precisions", "accuracy_rays", "speed_rays",
                                   "repeat", "threads", "seed", "deadline_ms"});
  if (problems.any()) return problems.first();
  TradeoffRequest request = read_members(object, max_threads, limits);
  if (!problems.any() && traces(request) > limits.tradeoff_traces)
    root.fail(
        ProblemCode::kOutOfRange,
        "ray_classes * (structures * precisions + 2) * (accuracy_rays + (repeat + 1) * speed_rays) may be at "
        "most " +
            std::to_string(limits.tradeoff_traces));
  if (problems.any()) return problems.first();
  return request;
}

}  // namespace gridcast::proto
