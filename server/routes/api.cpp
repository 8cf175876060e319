#include "server/routes/api.h"

#include <algorithm>
#include <charconv>
#include <cstdio>

#include "proto/etag.h"
#include "proto/media_type.h"
#include "server/http/problem.h"
#include "server/log.h"

namespace gridcast::server {

using proto::Problem;
using proto::ProblemCode;

namespace {

// A job may take all cores for minutes: at least half of the gate's places are left to requests.
std::size_t job_workers(std::size_t threads) {
  constexpr std::size_t kMostWorkers = 4;
  return std::clamp<std::size_t>(threads / 2, 1, kMostWorkers);
}

}  // namespace

Api::Api(const proto::Limits& limits_in_force, std::size_t thread_count,
         std::unique_ptr<store::SceneArchive> scene_archive)
    : limits(limits_in_force),
      archive(std::move(scene_archive)),
      trees(thread_count),
      store(limits.scenes, archive.get(), &trees, {limits.kept_versions, limits.log_bytes}),
      memory(limits.memory_budget_bytes),
      gate(thread_count + 1),
      update_gate(thread_count + 1),
      kept_answers(limits.idempotency_keys, limits.idempotency_bytes,
                   std::chrono::duration<double, std::milli>(limits.idempotency_keep_ms)),
      threads(thread_count),
      jobs(limits, gate, job_workers(thread_count), log_job) {
  memory.set_relief([this] { store.drop_history(); });
}

Router make_router(Api& api) {
  Router router;
  add_meta_routes(router, api);
  add_scene_routes(router, api);
  add_export_routes(router, api);
  add_mesh_routes(router, api);
  add_instance_routes(router, api);
  add_transaction_routes(router, api);
  add_pose_routes(router, api);
  add_log_routes(router, api);
  add_ray_routes(router, api);
  add_explain_routes(router, api);
  add_point_routes(router, api);
  add_visibility_routes(router, api);
  add_sensor_routes(router, api);
  add_render_routes(router, api);
  add_tradeoff_routes(router, api);
  add_job_routes(router, api);
  return router;
}

std::variant<OpenScene, Problem> open_scene(const Api& api, const HttpRequest& request) {
  const auto at_version = proto::parse_at_version(request.query);
  if (!at_version) return at_version.problem();
  auto named = api.store.find(request.capture("s"));
  if (!named) return api.store.why_missing(request.capture("s"));
  if (!*at_version) {
    auto newest = named->snapshot();
    return OpenScene{std::move(named), std::move(newest)};
  }
  auto snapshot = named->snapshot_at(**at_version);
  if (auto* problem = std::get_if<Problem>(&snapshot)) {
    problem->pointer = std::string("?").append(proto::kAtVersion);
    return std::move(*problem);
  }
  return OpenScene{std::move(named), std::get<0>(std::move(snapshot))};
}

std::optional<std::uint32_t> parse_id(std::string_view text) {
  std::uint32_t id = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), id);
  const bool canonical = text == "0" || (!text.empty() && text[0] != '0');
  if (!canonical || parsed.ec != std::errc() || parsed.ptr != text.data() + text.size() || id == kInvalidId)
    return std::nullopt;
  return id;
}

HttpResponse versioned_json(std::string body, std::uint64_t version, int status) {
  HttpResponse response{status, std::string(proto::kJsonMediaType), std::move(body), {}};
  response.with("Scene-Version", std::to_string(version)).with("ETag", proto::etag(version));
  return response;
}

std::optional<HttpResponse> not_modified(const HttpRequest& request, std::uint64_t version) {
  const std::string tags = request.header("if-none-match");
  if (tags.empty()) return std::nullopt;
  switch (proto::match_etag(tags, version, proto::TagComparison::kWeak)) {
    case proto::TagMatch::kDiffers:
      return std::nullopt;
    case proto::TagMatch::kMalformed:
      return problem_response({ProblemCode::kInvalidHeader,
                               "If-None-Match must be * or a list of quoted versions", "If-None-Match"});
    case proto::TagMatch::kMatches:
      break;
  }
  HttpResponse response{304, "", "", {}};
  response.with("Scene-Version", std::to_string(version)).with("ETag", proto::etag(version));
  return response;
}

double Timing::mark(std::string_view phase) {
  const Clock::time_point now = Clock::now();
  const double ms = ms_between(last_, now);
  add(phase, ms);
  return ms;
}

void Timing::add(std::string_view phase, double ms) {
  last_ = Clock::now();
  char text[64];
  std::snprintf(text, sizeof(text), "%.*s;dur=%.3f", int(phase.size()), phase.data(), ms);
  header_.append(header_.empty() ? "" : ", ").append(text);
}

std::variant<scene::UpdateResult, Problem> update_scene(
    Api& api, NamedScene& named, const HttpRequest& request, const SharedEdits& edits,
    const Cancellation& cancellation, const std::function<std::string(const std::string&)>& pointer_of) {
  auto result = named.update(request.header("if-match"), edits, cancellation.token());
  if (auto* problem = std::get_if<Problem>(&result)) return std::move(*problem);
  if (auto* error = std::get_if<Error>(&result)) {
    Problem problem = problem_of(*error, proto::ErrorContext::kUpdate, cancellation);
    problem.pointer = pointer_of(problem.pointer);
    return problem;
  }
  scene::UpdateResult& updated = std::get<scene::UpdateResult>(result);
  api.metrics.count_update(updated.report);
  return std::move(updated);
}

namespace {

const std::string kEdits = "/edits/";

/// What follows the edit's number: "/edits/7/rest" -> "/rest".
std::string within_edit(const std::string& pointer) {
  const std::size_t slash = pointer.find('/', kEdits.size());
  std::string rest = slash == std::string::npos ? std::string() : pointer.substr(slash);
  const std::string core_name = "/world_from_object";
  if (rest.ends_with(core_name)) rest.replace(rest.size() - core_name.size(), core_name.size(), "/transform");
  return rest;
}

}  // namespace

std::string pointer_of_one(const std::string& pointer) {
  return pointer.starts_with(kEdits) ? within_edit(pointer) : pointer;
}

Problem in_body(Problem problem) {
  if (problem.code == ProblemCode::kInstanceNotFound || problem.code == ProblemCode::kMeshNotFound)
    problem.code = ProblemCode::kInvalidValue;
  return problem;
}

std::variant<std::uint32_t, Problem> open_mesh(const scene::Scene& scene, const HttpRequest& request) {
  const auto id = parse_id(request.capture("m"));
  if (!id || *id >= scene.mesh_count())
    return Problem{ProblemCode::kMeshNotFound, "there is no such mesh", ""};
  return *id;
}

}  // namespace gridcast::server
