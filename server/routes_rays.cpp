#include <array>

#include "core/scene/trace.h"
#include "proto/hit_reply.h"
#include "proto/media_type.h"
#include "proto/ray_request.h"
#include "server/api.h"
#include "server/problem.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

enum class RayQuery { kClosest, kAny };
enum class ReplyFormat { kJson, kBinary };

/// What Accept asks for; without a preference, the answer comes in the form of the question.
std::optional<ReplyFormat> reply_format(const HttpRequest& request) {
  const auto type = proto::parse_media_type(request.header("content-type"));
  const bool binary_first = type && type->essence == proto::kRaysMediaType;
  std::array<std::string_view, 2> offered{proto::kJsonMediaType, proto::kHitsMediaType};
  if (binary_first) std::swap(offered[0], offered[1]);
  const auto chosen = proto::negotiate(request.header("accept"), offered);
  if (!chosen) return std::nullopt;
  return offered[*chosen] == proto::kJsonMediaType ? ReplyFormat::kJson : ReplyFormat::kBinary;
}

std::string encode(const HitColumns& hits, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_hits_json(hits, head)
                                      : write_hits_binary(hits, head).to_string();
}
std::string encode(const std::vector<RayStatus>& status, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_occlusion_json(status, head)
                                      : write_occlusion_binary(status, head).to_string();
}
const std::vector<RayStatus>& statuses(const HitColumns& hits) {
  return hits.status;
}
const std::vector<RayStatus>& statuses(const std::vector<RayStatus>& status) {
  return status;
}

proto::RayPlan plan_of(const scene::TraceStats& traced) {
  return {std::string(to_string(traced.order)), traced.reason, traced.packet_rays, traced.single_rays,
          traced.order_ms};
}

/// From the engine's answer to the client's.
template <class Answer>
HttpResponse reply(Api& api, const Result<Answer>& answer, const scene::Scene& scene,
                   const proto::RayRequest& rays, const scene::TraceStats& traced, ReplyFormat format,
                   const Cancellation& cancellation, Timing& timing) {
  const double trace_ms = timing.mark("trace");
  if (!answer) return problem_response(problem_of(answer.error(), proto::ErrorContext::kQuery, cancellation));
  api.metrics.count_rays(statuses(*answer).size(), trace_ms);
  proto::ReplyHead head{scene.version(), rays.options.fields, std::nullopt};
  if (rays.options.stats == proto::StatsMode::kOn) {
    head.stats = proto::count_statuses(statuses(*answer), trace_ms);
    head.stats->plan = plan_of(traced);
  }
  HttpResponse response{
      200,
      std::string(format == ReplyFormat::kJson ? proto::kJsonMediaType : proto::kHitsMediaType),
      encode(*answer, head, format),
      {}};
  timing.mark("encode");
  return response.with("Scene-Version", std::to_string(scene.version()))
      .with("Server-Timing", timing.header());
}

HttpResponse cast(Api& api, const HttpRequest& request, Cancellation& cancellation, RayQuery query) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  auto rays =
      proto::parse_ray_request(request.header("content-type"), request.body, request.query, api.limits);
  if (!rays) return problem_response(rays.problem());
  const auto format = reply_format(request);
  if (!format)
    return problem_response({ProblemCode::kNotAcceptable,
                             "answers are application/json or application/vnd.gridcast.hits", "Accept"});
  if (rays->options.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*rays->options.deadline_ms));
  timing.mark("parse");
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  scene::TraceStats traced;
  const scene::TraceOptions options{
      rays->options.precision, rays->options.fields, cancellation.token(), {}, &traced};
  if (query == RayQuery::kAny) {
    const auto answer = occluded(scene, rays->batch(), options);
    return reply(api, answer, scene, *rays, traced, *format, cancellation, timing);
  }
  const auto answer = intersect(scene, rays->batch(), options);
  return reply(api, answer, scene, *rays, traced, *format, cancellation, timing);
}

}  // namespace

void add_ray_routes(Router& router, Api& api) {
  const std::vector<AcceptedBody> bodies{{std::string(proto::kJsonMediaType), api.limits.json_bytes},
                                         {std::string(proto::kRaysMediaType), api.limits.binary_bytes}};
  router.add({"POST", "/v1/scenes/{s}/rays/closest", bodies,
              [&api](const HttpRequest& r, Cancellation& c) { return cast(api, r, c, RayQuery::kClosest); }});
  router.add({"POST", "/v1/scenes/{s}/rays/any", bodies,
              [&api](const HttpRequest& r, Cancellation& c) { return cast(api, r, c, RayQuery::kAny); }});
}

}  // namespace gridcast::server
