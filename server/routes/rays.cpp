#include "core/scene/all_hits.h"
#include "core/scene/trace.h"
#include "proto/media_type.h"
#include "proto/ray_request.h"
#include "server/access/caller.h"
#include "server/http/small_request.h"
#include "server/routes/api.h"
#include "server/routes/ray_pieces.h"
#include "server/routes/ray_reply.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::RayQuestion;

/// One request on its way to its answer.
struct Cast {
  Api& api;
  const scene::Scene& scene;
  const proto::RayRequest& rays;
  ReplyFormat format;
  const Cancellation& cancellation;
  Timing& timing;
};

RayReply to(const Cast& cast) {
  return {cast.api, cast.scene.version(), cast.rays.options, cast.format, cast.cancellation, cast.timing};
}

HttpResponse answer_traced(const Cast& cast, RayQuestion question) {
  scene::TraceStats traced;
  const scene::TraceOptions options{
      cast.rays.options.precision, cast.rays.options.fields, cast.cancellation.token(), {}, &traced,
      cast.rays.options.mask};
  if (question == RayQuestion::kAny)
    return reply(to(cast), occluded(cast.scene, cast.rays.batch(), options), &traced);
  return reply(to(cast), intersect(cast.scene, cast.rays.batch(), options), &traced);
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
  options.mask = cast.rays.options.mask;
  return reply(to(cast), intersect_all(cast.scene, cast.rays.batch(), options), nullptr);
}

HttpResponse cast_whole(Api& api, const HttpRequest& request, const std::string& body,
                        Cancellation& cancellation, RayQuestion question) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  auto rays =
      proto::parse_ray_request(request.header("content-type"), body, request.query, api.limits, question);
  if (!rays) return problem_response(rays.problem());
  const auto format = reply_format(request);
  if (!format) return not_acceptable();
  if (rays->options.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*rays->options.deadline_ms));
  if (const auto problem = access::charge_rays(request, double(rays->batch().size())))
    return problem_response(*problem);
  timing.mark("parse");
  // A few rays wait for nobody: beside large batches that would take longer than they do.
  const bool is_small = question != RayQuestion::kAll && body.size() <= kSmallBodyBytes;
  const auto permit = is_small ? api.gate.try_enter() : api.gate.enter(cancellation.token());
  if (!is_small && !permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  const Cast cast{api, *std::get<OpenScene>(opened).scene, *rays, *format, cancellation, timing};
  if (question == RayQuestion::kAll) return answer_all(cast);
  if (question == RayQuestion::kCount)
    return reply(
        to(cast),
        count_hits(cast.scene, cast.rays.batch(), {cancellation.token(), {}, cast.rays.options.mask}),
        nullptr);
  return answer_traced(cast, question);
}

HttpResponse cast_rays(Api& api, const HttpRequest& request, Cancellation& cancellation,
                       RayQuestion question) {
  if (request.incoming == nullptr) return cast_whole(api, request, request.body, cancellation, question);
  std::string body;
  if (auto answer = cast_in_pieces(api, request, cancellation, question, body)) return std::move(*answer);
  if (const auto problem = read_rest(*request.incoming, body)) return problem_response(*problem);
  return cast_whole(api, request, body, cancellation, question);
}

}  // namespace

void add_ray_routes(Router& router, Api& api) {
  const std::vector<AcceptedBody> bodies{{std::string(proto::kJsonMediaType), api.limits.json_bytes},
                                         {std::string(proto::kRaysMediaType), api.limits.binary_bytes}};
  const auto add = [&](const char* path, RayQuestion question) {
    router.add(
        {"POST", path, bodies,
         [&api, question](const HttpRequest& r, Cancellation& c) { return cast_rays(api, r, c, question); },
         BodyArrival::kOnTheWay});
  };
  add("/v1/scenes/{s}/rays/closest", RayQuestion::kClosest);
  add("/v1/scenes/{s}/rays/any", RayQuestion::kAny);
  add("/v1/scenes/{s}/rays/all", RayQuestion::kAll);
  add("/v1/scenes/{s}/rays/count", RayQuestion::kCount);
}

}  // namespace gridcast::server
