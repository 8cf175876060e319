#include <array>

#include "proto/media_type.h"
#include "proto/replies.h"
#include "proto/vertex_reply.h"
#include "proto/vertex_request.h"
#include "server/describe.h"
#include "server/http/problem.h"
#include "server/routes/api.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

HttpResponse list_meshes(Api& api, const HttpRequest& request) {
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  if (auto same = not_modified(request, scene.version())) return std::move(*same);
  return versioned_json(to_json(mesh_infos(scene), scene.version()), scene.version());
}

HttpResponse get_mesh(Api& api, const HttpRequest& request) {
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  auto mesh = open_mesh(scene, request);
  if (auto* problem = std::get_if<Problem>(&mesh)) return problem_response(*problem);
  if (auto same = not_modified(request, scene.version())) return std::move(*same);
  const auto info = mesh_info(scene, std::get<std::uint32_t>(mesh), TopologyDetail::kCounted);
  return versioned_json(to_json(info, scene.version()), scene.version());
}

HttpResponse too_many_vertices(std::string_view as, std::size_t bytes, std::string_view instead) {
  return problem_response({ProblemCode::kLimitExceeded,
                           "the vertices take more than " + std::to_string(bytes) + " bytes as " +
                               std::string(as) + std::string(instead),
                           "Accept"});
}

HttpResponse get_vertices(const Api& api, const HttpRequest& request) {
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  auto mesh = open_mesh(scene, request);
  if (auto* problem = std::get_if<Problem>(&mesh)) return problem_response(*problem);
  const std::array<std::string_view, 2> offered{proto::kJsonMediaType, proto::kVerticesMediaType};
  const auto chosen = proto::negotiate(request.header("accept"), offered);
  if (!chosen)
    return problem_response({ProblemCode::kNotAcceptable,
                             "vertices come as " + std::string(offered[0]) + " or " + std::string(offered[1]),
                             "Accept"});
  if (auto same = not_modified(request, scene.version())) return std::move(*same);
  const std::vector<Vec3f>& positions = scene.blas(std::get<std::uint32_t>(mesh)).mesh().positions;
  if (*chosen == 0) {
    auto text = proto::write_vertices_json(positions, api.limits.json_bytes);
    if (!text)
      return too_many_vertices(offered[0], api.limits.json_bytes, "; ask for " + std::string(offered[1]));
    return versioned_json(*std::move(text), scene.version());
  }
  if (positions.size() * sizeof(Vec3f) > api.limits.binary_bytes)
    return too_many_vertices(offered[1], api.limits.binary_bytes, "");
  HttpResponse response = versioned_json(proto::write_vertices_binary(positions), scene.version());
  response.content_type = std::string(offered[1]) + "; layout=whole";
  return response;
}

HttpResponse patch_vertices(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  OpenScene& open = std::get<OpenScene>(opened);
  auto mesh = open_mesh(*open.scene, request);
  if (auto* problem = std::get_if<Problem>(&mesh)) return problem_response(*problem);
  auto parsed =
      proto::parse_vertex_request(request.header("content-type"), request.body, request.query, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  timing.mark("parse");
  const auto permit = api.update_gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  scene::ReplaceVertices edit{std::get<std::uint32_t>(mesh), std::move(parsed->positions),
                              std::move(parsed->vertex_ids),
                              scene::parse_update_mode(parsed->update).value()};
  auto result =
      update_scene(api, *open.named, request, one_edit(std::move(edit)), cancellation, pointer_of_one);
  if (auto* problem = std::get_if<Problem>(&result)) return problem_response(*problem);
  timing.mark("update");
  const scene::UpdateResult& updated = std::get<scene::UpdateResult>(result);
  const scene::MeshUpdateReport& report = updated.report.meshes.at(0);
  const std::uint64_t version = updated.scene->version();
  HttpResponse response =
      versioned_json(to_json(proto::VertexReply{version, std::string(to_string(report.action)), report.reason,
                                                report.cost_before, report.cost_after, report.ms}),
                     version);
  return response.with("Server-Timing", timing.header());
}

}  // namespace

void add_mesh_routes(Router& router, Api& api) {
  router.add({"GET", "/v1/scenes/{s}/meshes", {}, [&api](const HttpRequest& r, Cancellation&) {
                return list_meshes(api, r);
              }});
  router.add({"GET", "/v1/scenes/{s}/meshes/{m}", {}, [&api](const HttpRequest& r, Cancellation&) {
                return get_mesh(api, r);
              }});
  const std::string vertices = "/v1/scenes/{s}/meshes/{m}/vertices";
  router.add(
      {"GET", vertices, {}, [&api](const HttpRequest& r, Cancellation&) { return get_vertices(api, r); }});
  router.add({"PATCH",
              vertices,
              {{std::string(proto::kJsonMediaType), api.limits.json_bytes},
               {std::string(proto::kVerticesMediaType), api.limits.binary_bytes}},
              once_per_key(
                  api, [&api](const HttpRequest& r, Cancellation& c) { return patch_vertices(api, r, c); })});
}

}  // namespace gridcast::server
