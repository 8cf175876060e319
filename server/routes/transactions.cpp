#include "proto/media_type.h"
#include "proto/transaction.h"
#include "proto/vocabulary.h"
#include "server/http/problem.h"
#include "server/routes/api.h"
#include "server/routes/instance_edit.h"
#include "server/routes/pose_edit.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

struct ToSceneEdit {
  scene::SceneEdit operator()(proto::AddInstanceRequest& edit) const {
    return scene::AddInstance{edit.mesh_id, edit.world_from_object, std::move(edit.name), edit.mask};
  }
  scene::SceneEdit operator()(proto::InstanceMove& edit) const {
    return scene::MoveInstance{edit.instance_id, edit.world_from_object};
  }
  scene::SceneEdit operator()(proto::InstanceChange& edit) const { return change_edit(std::move(edit)); }
  scene::SceneEdit operator()(proto::RemoveInstanceRequest& edit) const {
    return scene::RemoveInstance{edit.instance_id};
  }
  scene::SceneEdit operator()(proto::MeshVerticesRequest& edit) const {
    return scene::ReplaceVertices{edit.mesh_id, std::move(edit.vertices.positions),
                                  std::move(edit.vertices.vertex_ids),
                                  scene::parse_update_mode(edit.vertices.update).value()};
  }
  scene::SceneEdit operator()(proto::PoseEditRequest& edit) const { return pose_edit(std::move(edit.pose)); }
};

/// Core's names of an edit's members are the wire's, but for two.
std::string pointer_of_edits(const std::string& pointer) {
  std::string wire = pointer;
  for (const auto& [core, name] : {std::pair{"/world_from_object", "/transform"}, {"/mode", "/update"}})
    if (const std::size_t at = wire.rfind(core); at != std::string::npos)
      wire.replace(at, std::string_view(core).size(), name);
  return wire;
}

/// The replies of the edits, in their order (`pose_names` are the poses' own); the report's lists hold those
/// of their kind in the same order.
std::vector<proto::EditReply> edit_replies(const std::vector<scene::SceneEdit>& edits,
                                           const std::vector<std::string>& pose_names,
                                           const scene::UpdateReport& report) {
  std::vector<proto::EditReply> replies;
  replies.reserve(edits.size());
  auto added = report.added_instances.begin();
  auto mesh = report.meshes.begin();
  auto pose = report.poses.begin();
  for (const scene::SceneEdit& edit : edits) {
    proto::EditReply reply;
    if (const auto* add = std::get_if<scene::AddInstance>(&edit)) {
      reply = {std::string(proto::kEditNames[0]), *added++, add->mesh_id, std::nullopt, std::nullopt};
    } else if (const auto* move = std::get_if<scene::MoveInstance>(&edit)) {
      reply = {std::string(proto::kEditNames[1]), move->instance_id, std::nullopt, std::nullopt,
               std::nullopt};
    } else if (const auto* removed = std::get_if<scene::RemoveInstance>(&edit)) {
      reply = {std::string(proto::kEditNames[2]), removed->instance_id, std::nullopt, std::nullopt,
               std::nullopt};
    } else if (const auto* change = std::get_if<scene::ChangeInstance>(&edit)) {
      reply = {std::string(proto::kEditNames[6]), change->instance_id, std::nullopt, std::nullopt,
               std::nullopt};
    } else if (std::holds_alternative<scene::SetPose>(edit)) {
      reply.op = pose_names[std::size_t(pose - report.poses.begin())];
      reply.pose = {pose->moved_instances, posed_meshes(pose->meshes)};
      ++pose;
    } else {
      reply = {std::string(proto::kEditNames[3]), std::nullopt, mesh->mesh_id,
               proto::EditReply::Vertices{std::string(to_string(mesh->action)), mesh->reason,
                                          mesh->cost_before, mesh->cost_after},
               std::nullopt};
      ++mesh;
    }
    replies.push_back(std::move(reply));
  }
  return replies;
}

HttpResponse post_transaction(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  auto parsed = proto::parse_transaction(request.body, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  const auto edits = std::make_shared<std::vector<scene::SceneEdit>>();
  edits->reserve(parsed->size());
  std::vector<std::string> pose_names;
  for (proto::TransactionEdit& edit : *parsed) {
    if (const auto* pose = std::get_if<proto::PoseEditRequest>(&edit)) pose_names.push_back(pose->op);
    edits->push_back(std::visit(ToSceneEdit{}, edit));
  }
  timing.mark("parse");
  const auto permit = api.update_gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  auto result = update_scene(api, *std::get<OpenScene>(opened).named, request, SharedEdits(edits),
                             cancellation, pointer_of_edits);
  if (auto* problem = std::get_if<Problem>(&result)) return problem_response(in_body(std::move(*problem)));
  timing.mark("update");
  const scene::UpdateResult& updated = std::get<scene::UpdateResult>(result);
  const std::uint64_t version = updated.scene->version();
  HttpResponse response =
      versioned_json(to_json(proto::TransactionReply{
                         version, edit_replies(*edits, pose_names, updated.report), updated.report.ms}),
                     version);
  return response.with("Server-Timing", timing.header());
}

}  // namespace

void add_transaction_routes(Router& router, Api& api) {
  router.add({"POST",
              "/v1/scenes/{s}/transactions",
              {{std::string(proto::kJsonMediaType), api.limits.json_bytes}},
              once_per_key(api, [&api](const HttpRequest& r, Cancellation& c) {
                return post_transaction(api, r, c);
              })});
}

}  // namespace gridcast::server
