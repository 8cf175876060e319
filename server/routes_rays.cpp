#include "core/scene/all_hits.h"
#include "core/scene/trace.h"
#include "proto/hit_reply.h"
#include "proto/list_reply.h"
#include "proto/media_type.h"
#include "proto/ray_request.h"
#include "server/api.h"
#include "server/problem.h"
#include "server/reply_format.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::RayQuestion;

std::string encode(const HitColumns& hits, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_hits_json(hits, head)
                                      : write_hits_binary(hits, head).to_string();
}
std::string encode(const std::vector<RayStatus>& status, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_occlusion_json(status, head)
                                      : write_occlusion_binary(status, head).to_string();
}
std::string encode(const HitLists& lists, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_lists_json(lists, head)
                                      : write_lists_binary(lists, head).to_string();
}
std::string encode(const HitCounts& counts, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_counts_json(counts, head)
                                      : write_counts_binary(counts, head).to_string();
}
template <class Answer>
const std::vector<RayStatus>& statuses(const Answer& answer) {
  return answer.status;
}
const std::vector<RayStatus>& statuses(const std::vector<RayStatus>& status) {
  return status;
}

proto::RayPlan plan_of(const scene::TraceStats& traced) {
  return {std::string(to_string(traced.order)), traced.reason, traced.packet_rays, traced.single_rays,
          traced.order_ms};
}

/// One request on its way to its answer.
struct Cast {
  Api& api;
  const scene::Scene& scene;
  const proto::RayRequest& rays;
  ReplyFormat format;
  const Cancellation& cancellation;
  Timing& timing;
};

/// From the engine's answer to the client's. `traced` is null where rays are taken as they come.
template <class Answer>
HttpResponse reply(const Cast& cast, const Result<Answer>& answer, const scene::TraceStats* traced) {
  const double trace_ms = cast.timing.mark("trace");
  if (!answer)
    return problem_response(problem_of(answer.error(), proto::ErrorContext::kQuery, cast.cancellation));
  cast.api.metrics.count_rays(statuses(*answer).size(), trace_ms);
  const std::uint64_t version = cast.scene.version();
  proto::ReplyHead head{version, cast.rays.options.fields, std::nullopt};
  if (cast.rays.options.stats == proto::StatsMode::kOn) {
    head.stats = proto::count_statuses(statuses(*answer), trace_ms);
    if (traced != nullptr) head.stats->plan = plan_of(*traced);
  }
  std::string body = encode(*answer, head, cast.format);
  cast.timing.mark("encode");
  return columns_response(std::move(body), cast.format, version, cast.timing);
}

HttpResponse answer_traced(const Cast& cast, RayQuestion question) {
  scene::TraceStats traced;
  const scene::TraceOptions options{
      cast.rays.options.precision, cast.rays.options.fields, cast.cancellation.token(), {}, &traced};
  if (question == RayQuestion::kAny)
    return reply(cast, occluded(cast.scene, cast.rays.batch(), options), &traced);
  return reply(cast, intersect(cast.scene, cast.rays.batch(), options), &traced);
}

HttpResponse answer_all(const Cast& cast) {
  const proto::Limits& limits = cast.api.limits;
  scene::AllHitsOptions options;
  options.precision = cast.rays.options.precision;
  options.fields = cast.rays.options.fields;
  options.max_hits = cast.rays.options.max_hits.value_or(std::uint32_t(limits.hits_per_ray));
  options.max_total_hits = cast.format == ReplyFormat::kJson ? limits.json_hits : limits.binary_hits;
  options.after = cast.rays.after;
  options.stop = cast.cancellation.token();
  return reply(cast, intersect_all(cast.scene, cast.rays.batch(), options), nullptr);
}

HttpResponse cast_rays(Api& api, const HttpRequest& request, Cancellation& cancellation,
                       RayQuestion question) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  auto rays = proto::parse_ray_request(request.header("content-type"), request.body, request.query,
                                       api.limits, question);
  if (!rays) return problem_response(rays.problem());
  const auto format = reply_format(request);
  if (!format) return not_acceptable();
  if (rays->options.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*rays->options.deadline_ms));
  timing.mark("parse");
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  const Cast cast{api, *std::get<OpenScene>(opened).scene, *rays, *format, cancellation, timing};
  if (question == RayQuestion::kAll) return answer_all(cast);
  if (question == RayQuestion::kCount)
    return reply(cast, count_hits(cast.scene, cast.rays.batch(), {cancellation.token(), {}}), nullptr);
  return answer_traced(cast, question);
}

}  // namespace

void add_ray_routes(Router& router, Api& api) {
  const std::vector<AcceptedBody> bodies{{std::string(proto::kJsonMediaType), api.limits.json_bytes},
                                         {std::string(proto::kRaysMediaType), api.limits.binary_bytes}};
  const auto add = [&](const char* path, RayQuestion question) {
    router.add({"POST", path, bodies, [&api, question](const HttpRequest& r, Cancellation& c) {
                  return cast_rays(api, r, c, question);
                }});
  };
  add("/v1/scenes/{s}/rays/closest", RayQuestion::kClosest);
  add("/v1/scenes/{s}/rays/any", RayQuestion::kAny);
  add("/v1/scenes/{s}/rays/all", RayQuestion::kAll);
  add("/v1/scenes/{s}/rays/count", RayQuestion::kCount);
}

}  // namespace gridcast::server
