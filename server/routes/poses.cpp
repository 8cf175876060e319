#include "core/scene/pose.h"
#include "proto/media_type.h"
#include "server/http/problem.h"
#include "server/routes/api.h"
#include "server/routes/pose_edit.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

HttpResponse get_pose(Api& api, const HttpRequest& request) {
  auto page = proto::parse_page(request.query, api.limits.instances_per_page);
  if (!page) return problem_response(page.problem());
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  if (auto same = not_modified(request, scene.version())) return std::move(*same);
  return versioned_json(to_json(pose_info(scene, page->offset, page->limit)), scene.version());
}

/// The mesh of the path, which has morph targets.
std::variant<std::uint32_t, Problem> open_morphed(const scene::Scene& scene, const HttpRequest& request) {
  auto mesh = open_mesh(scene, request);
  if (const auto* id = std::get_if<std::uint32_t>(&mesh);
      id != nullptr && !scene.pose().weights.contains(*id))
    return Problem{ProblemCode::kInvalidValue, "the mesh has no morph targets", ""};
  return mesh;
}

HttpResponse get_weights(Api& api, const HttpRequest& request) {
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  auto mesh = open_mesh(scene, request);
  if (auto* problem = std::get_if<Problem>(&mesh)) return problem_response(*problem);
  if (auto same = not_modified(request, scene.version())) return std::move(*same);
  proto::WeightsInfo info{scene.version(), std::get<std::uint32_t>(mesh), {}};
  const auto weights = scene.pose().weights.find(info.mesh_id);
  if (weights != scene.pose().weights.end()) info.weights = weights->second;
  return versioned_json(to_json(info), scene.version());
}

/// Core's pointer into the one edit, as the body has it.
std::string pointer_of_pose(const std::string& pointer) {
  std::string wire = pointer_of_one(pointer);
  return wire == "/mode" ? "/update" : wire;
}

/// The same for PUT weights, whose body is the list's one entry: `/weights/0/weights/3` is `/weights/3`.
std::string pointer_of_weights(const std::string& pointer) {
  const std::string entry = "/weights/0";
  std::string wire = pointer_of_pose(pointer);
  if (!wire.starts_with(entry)) return wire;
  return wire == entry ? "/weights" : wire.substr(entry.size());
}

/// One pose, applied in its turn.
std::variant<scene::UpdateResult, Problem> apply_pose(
    Api& api, const HttpRequest& request, NamedScene& named, proto::PoseRequest pose,
    const Cancellation& cancellation, Timing& timing,
    const std::function<std::string(const std::string&)>& pointer_of) {
  timing.mark("parse");
  const auto permit = api.update_gate.enter(cancellation.token());
  if (!permit) return cancelled_problem(cancellation.reason());
  timing.mark("wait");
  auto result =
      update_scene(api, named, request, one_edit(pose_edit(std::move(pose))), cancellation, pointer_of);
  if (auto* problem = std::get_if<Problem>(&result)) return in_body(std::move(*problem));
  timing.mark("update");
  return result;
}

/// Every mesh that deforms: what was done to it, or none.
std::vector<proto::PosedMesh> all_posed_meshes(const scene::Scene& scene, const scene::PoseReport& report) {
  std::vector<proto::PosedMesh> meshes;
  auto changed = report.meshes.begin();
  for (std::uint32_t m = 0; m < scene.rig().meshes.size(); ++m) {
    if (!scene.rig().meshes[m].deforms) continue;
    const bool is_changed = changed != report.meshes.end() && changed->mesh_id == m;
    meshes.push_back(is_changed ? posed_mesh(*changed++) : unchanged_mesh(scene, m));
  }
  return meshes;
}

HttpResponse put_pose(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  auto parsed = proto::parse_pose_request(request.body, request.query, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  auto result = apply_pose(api, request, *std::get<OpenScene>(opened).named, std::move(parsed).value(),
                           cancellation, timing, pointer_of_pose);
  if (auto* problem = std::get_if<Problem>(&result)) return problem_response(*problem);
  const auto& [scene, report] = std::get<scene::UpdateResult>(result);
  const scene::PoseReport& pose = report.poses.at(0);
  const proto::PoseReply reply{scene->version(),        played_animation(*scene),       pose.moved_instances,
                               pose.inactive_instances, all_posed_meshes(*scene, pose), report.ms};
  return versioned_json(to_json(reply), scene->version()).with("Server-Timing", timing.header());
}

HttpResponse put_weights(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  OpenScene& open = std::get<OpenScene>(opened);
  auto mesh = open_morphed(*open.scene, request);
  if (auto* problem = std::get_if<Problem>(&mesh)) return problem_response(*problem);
  const auto mesh_id = std::get<std::uint32_t>(mesh);
  auto parsed = proto::parse_weights_request(mesh_id, request.body, request.query, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  auto result = apply_pose(api, request, *open.named, std::move(parsed).value(), cancellation, timing,
                           pointer_of_weights);
  if (auto* problem = std::get_if<Problem>(&result)) return problem_response(*problem);
  const auto& [scene, report] = std::get<scene::UpdateResult>(result);
  const auto& changed = report.poses.at(0).meshes;
  const proto::WeightsReply reply{
      scene->version(), changed.empty() ? unchanged_mesh(*scene, mesh_id) : posed_mesh(changed.front())};
  return versioned_json(to_json(reply), scene->version()).with("Server-Timing", timing.header());
}

}  // namespace

void add_pose_routes(Router& router, Api& api) {
  const std::vector<AcceptedBody> json{{std::string(proto::kJsonMediaType), api.limits.json_bytes}};
  const std::string pose = "/v1/scenes/{s}/pose", weights = "/v1/scenes/{s}/meshes/{m}/weights";
  router.add({"GET", pose, {}, [&api](const HttpRequest& r, Cancellation&) { return get_pose(api, r); }});
  router.add(
      {"PUT", pose, json, [&api](const HttpRequest& r, Cancellation& c) { return put_pose(api, r, c); }});
  router.add(
      {"GET", weights, {}, [&api](const HttpRequest& r, Cancellation&) { return get_weights(api, r); }});
  router.add({"PUT", weights, json,
              [&api](const HttpRequest& r, Cancellation& c) { return put_weights(api, r, c); }});
}

}  // namespace gridcast::server
