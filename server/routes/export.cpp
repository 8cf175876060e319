#include <array>

#include "core/io/gltf_export.h"
#include "proto/etag.h"
#include "proto/media_type.h"
#include "proto/query.h"
#include "server/http/problem.h"
#include "server/routes/api.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

/// Why there is no memory for an answer that takes `bytes` while it is made, if so.
std::optional<Problem> check_answer_memory(const Api& api, std::uint64_t bytes) {
  const MemoryBudget::Level level = api.memory.level(bytes);
  const bool is_much = bytes > MemoryBudget::kSmallBytes;
  if (level == MemoryBudget::Level::kFree || (level == MemoryBudget::Level::kTight && !is_much))
    return std::nullopt;
  return Problem{ProblemCode::kOverloaded, "the server's memory is nearly used up", ""};
}

HttpResponse export_scene(Api& api, const HttpRequest& request, const Cancellation& cancellation) {
  Timing timing;
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  const std::array<std::string_view, 1> offered{proto::kGlbMediaType};
  if (!proto::negotiate(request.header("accept"), offered))
    return problem_response(
        {ProblemCode::kNotAcceptable, "scenes are exported as " + std::string(offered[0]), "Accept"});
  if (auto same = not_modified(request, scene.version())) return std::move(*same);
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  io::ExportOptions options;
  options.limits.file_bytes = api.limits.glb_bytes;
  options.stop = cancellation.token();
  if (const auto problem = check_answer_memory(api, io::export_memory_bytes(scene, options.limits)))
    return problem_response(*problem);
  auto glb = io::export_glb(scene, options);
  if (!glb) return problem_response(problem_of(glb.error(), proto::ErrorContext::kQuery, cancellation));
  timing.mark("encode");
  HttpResponse response{200, std::string(proto::kGlbMediaType), std::move(glb).value(), {}};
  response.with("Scene-Version", std::to_string(scene.version())).with("ETag", proto::etag(scene.version()));
  return response.with("Server-Timing", timing.header());
}

}  // namespace

void add_export_routes(Router& router, Api& api) {
  router.add({"GET", "/v1/scenes/{s}/export", {}, [&api](const HttpRequest& r, const Cancellation& c) {
                return export_scene(api, r, c);
              }});
}

}  // namespace gridcast::server
