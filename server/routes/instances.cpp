#include <algorithm>

#include "proto/etag.h"
#include "proto/media_type.h"
#include "proto/replies.h"
#include "proto/scene_request.h"
#include "server/describe.h"
#include "server/http/problem.h"
#include "server/routes/api.h"
#include "server/routes/instance_edit.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

Problem no_instance() {
  return {ProblemCode::kInstanceNotFound, "there is no such instance", ""};
}

HttpResponse list_instances(Api& api, const HttpRequest& request) {
  auto page = proto::parse_page(request.query, api.limits.instances_per_page);
  if (!page) return problem_response(page.problem());
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  if (auto same = not_modified(request, scene.version())) return std::move(*same);
  return versioned_json(to_json(instance_list(scene, *page)), scene.version());
}

HttpResponse get_instance(Api& api, const HttpRequest& request) {
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  const auto id = parse_id(request.capture("i"));
  if (!id || !scene.find_instance(*id)) return problem_response(no_instance());
  if (auto same = not_modified(request, scene.version())) return std::move(*same);
  return versioned_json(to_json(instance_info(scene, *id), scene.version()), scene.version());
}

HttpResponse add_instance(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  OpenScene& open = std::get<OpenScene>(opened);
  auto parsed = proto::parse_add_instance(request.body, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  if (parsed->mesh_id >= open.scene->mesh_count())
    return problem_response({ProblemCode::kMeshNotFound, "there is no such mesh", "/mesh_id"});
  scene::AddInstance edit{parsed->mesh_id, parsed->world_from_object, std::move(parsed->name), parsed->mask};
  auto result = update_scene(api, *open.named, request, {std::move(edit)}, cancellation, pointer_of_one);
  if (auto* problem = std::get_if<Problem>(&result)) return problem_response(*problem);
  const scene::UpdateResult& updated = std::get<scene::UpdateResult>(result);
  const std::uint32_t id = updated.report.added_instances.at(0);
  const std::uint64_t version = updated.scene->version();
  HttpResponse response = versioned_json(to_json(instance_info(*updated.scene, id), version), version, 201);
  return response.with("Location", "/v1/scenes/" + open.named->id() + "/instances/" + std::to_string(id));
}

HttpResponse change_instance(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  OpenScene& open = std::get<OpenScene>(opened);
  const auto id = parse_id(request.capture("i"));
  if (!id) return problem_response(no_instance());
  auto parsed = proto::parse_change_instance(request.body, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  auto result = update_scene(api, *open.named, request, {change_edit({*id, *std::move(parsed)})},
                             cancellation, pointer_of_one);
  if (auto* problem = std::get_if<Problem>(&result)) return problem_response(*problem);
  const auto& scene = std::get<scene::UpdateResult>(result).scene;
  return versioned_json(to_json(instance_info(*scene, *id), scene->version()), scene->version());
}

/// As one edit where all are moves: that is the fast way.
std::vector<scene::SceneEdit> edits_of(proto::InstancePatch patch) {
  std::vector<scene::SceneEdit> edits;
  edits.reserve(std::max<std::size_t>(patch.changes.size(), 1));
  for (proto::InstanceChange& one : patch.changes) edits.emplace_back(change_edit(std::move(one)));
  if (!edits.empty()) return edits;
  scene::MoveInstances moves;
  moves.moves.reserve(patch.moves.size());
  for (const proto::InstanceMove& move : patch.moves)
    moves.moves.push_back({move.instance_id, move.world_from_object});
  edits.emplace_back(std::move(moves));
  return edits;
}

/// Where each change is an edit of its own, its number is that of the move.
std::string pointer_of_change(const std::string& pointer) {
  constexpr std::string_view kEdits = "/edits";
  if (!pointer.starts_with(kEdits)) return pointer;
  const std::size_t end = std::min(pointer.find('/', kEdits.size() + 1), pointer.size());
  return "/moves" + pointer.substr(kEdits.size(), end - kEdits.size()) + pointer_of_one(pointer);
}

HttpResponse move_instances(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  OpenScene& open = std::get<OpenScene>(opened);
  auto parsed = proto::parse_move_instances(request.header("content-type"), request.body, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  const std::size_t count = parsed->size();
  const bool changes = !parsed->changes.empty();
  std::vector<scene::SceneEdit> edits = edits_of(*std::move(parsed));
  timing.mark("parse");
  auto result = update_scene(api, *open.named, request, std::move(edits), cancellation,
                             changes ? pointer_of_change : pointer_of_one);
  if (auto* problem = std::get_if<Problem>(&result)) return problem_response(*problem);
  timing.mark("update");
  const scene::UpdateResult& updated = std::get<scene::UpdateResult>(result);
  const std::uint64_t version = updated.scene->version();
  HttpResponse response =
      versioned_json(to_json(proto::MovesReply{version, count, updated.report.ms}), version);
  return response.with("Server-Timing", timing.header());
}

HttpResponse remove_instance(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const auto id = parse_id(request.capture("i"));
  if (!id) return problem_response(no_instance());
  auto result = update_scene(api, *std::get<OpenScene>(opened).named, request, {scene::RemoveInstance{*id}},
                             cancellation, pointer_of_one);
  if (auto* problem = std::get_if<Problem>(&result)) return problem_response(*problem);
  const std::uint64_t version = std::get<scene::UpdateResult>(result).scene->version();
  HttpResponse response{204, "", "", {}};
  return response.with("Scene-Version", std::to_string(version)).with("ETag", proto::etag(version));
}

}  // namespace

void add_instance_routes(Router& router, Api& api) {
  const std::vector<AcceptedBody> json{{std::string(proto::kJsonMediaType), api.limits.json_bytes}};
  const std::string all = "/v1/scenes/{s}/instances";
  const std::string one = all + "/{i}";
  router.add(
      {"GET", all, {}, [&api](const HttpRequest& r, Cancellation&) { return list_instances(api, r); }});
  router.add({"POST", all, json, once_per_key(api, [&api](const HttpRequest& r, Cancellation& c) {
                return add_instance(api, r, c);
              })});
  const std::vector<AcceptedBody> moves{{std::string(proto::kJsonMediaType), api.limits.json_bytes},
                                        {std::string(proto::kInstancesMediaType), api.limits.binary_bytes}};
  router.add({"PATCH", all, moves, once_per_key(api, [&api](const HttpRequest& r, Cancellation& c) {
                return move_instances(api, r, c);
              })});
  router.add({"GET", one, {}, [&api](const HttpRequest& r, Cancellation&) { return get_instance(api, r); }});
  router.add({"PATCH", one, json, once_per_key(api, [&api](const HttpRequest& r, Cancellation& c) {
                return change_instance(api, r, c);
              })});
  router.add({"DELETE", one, {}, [&api](const HttpRequest& r, Cancellation& c) {
                return remove_instance(api, r, c);
              }});
}

}  // namespace gridcast::server
