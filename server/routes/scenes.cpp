#include <cmath>

#include "proto/media_type.h"
#include "proto/replies.h"
#include "proto/scene_request.h"
#include "server/access/caller.h"
#include "server/describe.h"
#include "server/http/problem.h"
#include "server/load.h"
#include "server/routes/api.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

enum class SceneBody { kModel, kJson };

/// Beyond the deadline, which ends the work first.
constexpr double kCpuSlackS = 2.0;

/// What is left of the memory, and the time that a request has.
ImportBounds import_bounds(const Api& api) {
  ImportBounds bounds;
  bounds.cpu_s = std::uint64_t(std::ceil(api.limits.deadline_ms / 1000.0 + kCpuSlackS));
  if (api.memory.bytes() == 0) return bounds;
  const std::uint64_t used = api.memory.used();
  bounds.memory_bytes = api.memory.bytes() > used ? api.memory.bytes() - used : 0;
  return bounds;
}

/// By the helper, where there is one.
Result<LoadedScene> load_model(const Api& api, std::span<const std::byte> bytes, const LoadOptions& options) {
  if (!api.importer) return load_scene(bytes, options);
  return load_scene(
      [&] { return api.importer->import(bytes, options.gltf, import_bounds(api), options.stop); }, options);
}

std::variant<LoadedScene, Problem> load(const Api& api, const HttpRequest& request,
                                        const proto::SceneQuery& query, SceneBody body,
                                        const Cancellation& cancellation) {
  LoadOptions options;
  options.blas.kind = blas::parse_structure_kind(query.structure).value();
  options.blas.quality = blas::parse_build_quality(query.quality).value();
  options.gltf.scene_index = query.gltf_scene;
  options.gltf.limits.file_bytes = api.limits.glb_bytes;
  options.stop = cancellation.token();
  if (body == SceneBody::kModel) {
    auto loaded = load_model(api, std::as_bytes(std::span(request.body)), options);
    if (!loaded) return problem_of(loaded.error(), proto::ErrorContext::kImport, cancellation);
    return std::move(loaded).value();
  }
  auto empty = build_scene(scene::SceneData{}, {options.blas, options.stop, {}});
  if (!empty) return problem_of(empty.error(), proto::ErrorContext::kImport, cancellation);
  return LoadedScene{std::move(empty).value(), 0.0, 0.0};
}

/// The name of the new scene: from the query, else from a JSON body, else empty (the store makes one).
std::variant<std::string, Problem> wanted_name(const Api& api, const HttpRequest& request,
                                               const proto::SceneQuery& query, SceneBody body) {
  std::string name = query.name;
  std::string pointer = "?name";
  if (body == SceneBody::kJson) {
    auto empty = proto::parse_empty_scene(request.body, api.limits);
    if (!empty) return empty.problem();
    if (name.empty()) {
      name = empty->name;
      pointer = "/name";
    }
  }
  if (!name.empty() && !SceneStore::is_valid_id(name))
    return Problem{ProblemCode::kInvalidValue, "a name has 1 to 64 letters, digits, '_', '.' or '-'",
                   pointer};
  if (auto problem = api.store.check_new(name)) return std::move(*problem);
  return name;
}

HttpResponse create_scene(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  auto query = proto::parse_scene_query(request.query, api.limits);
  if (!query) return problem_response(query.problem());
  const auto type = proto::parse_media_type(request.header("content-type"));
  const SceneBody body = type->essence == proto::kJsonMediaType ? SceneBody::kJson : SceneBody::kModel;
  auto name = wanted_name(api, request, *query, body);
  if (auto* problem = std::get_if<Problem>(&name)) return problem_response(*problem);
  timing.mark("parse");

  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  auto loaded = load(api, request, *query, body, cancellation);
  if (auto* problem = std::get_if<Problem>(&loaded)) return problem_response(*problem);
  timing.mark("build");

  const LoadedScene& made = std::get<LoadedScene>(loaded);
  auto created = api.store.create(std::get<std::string>(name), made.scene,
                                  {query->structure, made.import_ms, made.build_ms});
  if (auto* problem = std::get_if<Problem>(&created)) return problem_response(*problem);
  const NamedScene& named = *std::get<std::shared_ptr<NamedScene>>(created);
  HttpResponse response = versioned_json(to_json(scene_info(named, *made.scene)), made.scene->version(), 201);
  return response.with("Location", "/v1/scenes/" + named.id()).with("Server-Timing", timing.header());
}

HttpResponse list_scenes(Api& api, const HttpRequest& request) {
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  std::vector<proto::SceneInfo> infos;
  for (const auto& named : api.store.list()) {
    if (!access::sees_scene(request, named->id())) continue;
    infos.push_back(scene_info(*named, *named->snapshot()));
    infos.back().rig.reset();
  }
  std::vector<std::string> damaged = api.store.damaged();
  std::erase_if(damaged, [&](const std::string& id) { return !access::sees_scene(request, id); });
  return {200, std::string(proto::kJsonMediaType), to_json(infos, damaged), {}};
}

HttpResponse get_scene(Api& api, const HttpRequest& request) {
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const OpenScene& open = std::get<OpenScene>(opened);
  if (auto same = not_modified(request, open.scene->version())) return std::move(*same);
  return versioned_json(to_json(scene_info(*open.named, *open.scene)), open.scene->version());
}

HttpResponse delete_scene(Api& api, const HttpRequest& request) {
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  if (const auto problem = api.store.erase(request.capture("s"), request.header("if-match")))
    return problem_response(*problem);
  return {204, "", "", {}};
}

/// The copy shares everything with the original until one of them changes.
HttpResponse fork_scene(Api& api, const HttpRequest& request) {
  auto name = proto::parse_fork_query(request.query);
  if (!name) return problem_response(name.problem());
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const auto& [named, scene] = std::get<OpenScene>(opened);
  if (const auto problem = check_if_match(request.header("if-match"), scene->version()))
    return problem_response(*problem);
  auto created = api.store.create(*std::move(name), scene, named->origin());
  if (auto* problem = std::get_if<Problem>(&created)) return problem_response(*problem);
  const NamedScene& copy = *std::get<std::shared_ptr<NamedScene>>(created);
  HttpResponse response = versioned_json(to_json(scene_info(copy, *scene)), scene->version(), 201);
  return response.with("Location", "/v1/scenes/" + copy.id());
}

/// Counts the steps of rays in every tree, as heavy work that waits for its turn.
std::optional<Problem> add_steps(Api& api, const HttpRequest& request, const scene::Scene& scene,
                                 const proto::StructureQuery& query, Cancellation& cancellation,
                                 proto::StructureInfo& info) {
  if (query.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*query.deadline_ms));
  const double rays = double(query.steps) * double(info.meshes.size());
  if (auto problem = access::charge_rays(request, rays)) return problem;
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return cancelled_problem(cancellation.reason());
  const Status counted = count_steps(scene, query.steps, cancellation.token(), info);
  if (!counted) return problem_of(counted.error(), proto::ErrorContext::kQuery, cancellation);
  return std::nullopt;
}

HttpResponse get_structure(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  const auto query = proto::parse_structure_query(request.query, api.limits);
  if (!query) return problem_response(query.problem());
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  // Never 304: a better tree comes in without a new version.
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  proto::StructureInfo info = structure_info(scene);
  if (query->steps > 0) {
    if (const auto problem = add_steps(api, request, scene, *query, cancellation, info))
      return problem_response(*problem);
  }
  return versioned_json(to_json(info), scene.version());
}

}  // namespace

void add_scene_routes(Router& router, Api& api) {
  const std::size_t model_bytes = api.limits.glb_bytes;
  router.add(
      {"GET", "/v1/scenes", {}, [&api](const HttpRequest& r, Cancellation&) { return list_scenes(api, r); }});
  router.add(
      {"POST",
       "/v1/scenes",
       {{std::string(proto::kGlbMediaType), model_bytes},
        {std::string(proto::kGltfMediaType), model_bytes},
        {std::string(proto::kJsonMediaType), api.limits.json_bytes}},
       once_per_key(api, [&api](const HttpRequest& r, Cancellation& c) { return create_scene(api, r, c); })});
  router.add({"GET", "/v1/scenes/{s}", {}, [&api](const HttpRequest& r, Cancellation&) {
                return get_scene(api, r);
              }});
  router.add({"DELETE", "/v1/scenes/{s}", {}, [&api](const HttpRequest& r, Cancellation&) {
                return delete_scene(api, r);
              }});
  router.add(
      {"POST", "/v1/scenes/{s}:fork", {}, once_per_key(api, [&api](const HttpRequest& r, Cancellation&) {
         return fork_scene(api, r);
       })});
  router.add({"GET", "/v1/scenes/{s}/structure", {}, [&api](const HttpRequest& r, Cancellation& c) {
                return get_structure(api, r, c);
              }});
}

}  // namespace gridcast::server
