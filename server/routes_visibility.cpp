#include "core/scene/visibility.h"
#include "proto/media_type.h"
#include "proto/visibility_reply.h"
#include "proto/visibility_request.h"
#include "server/api.h"
#include "server/problem.h"
#include "server/reply_format.h"

namespace gridcast::server {
namespace {

using proto::Problem;

std::string encode(const HitColumns& blockers, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_blockers_json(blockers, head)
                                      : write_hits_binary(blockers, head).to_string();
}
std::string encode(const std::vector<RayStatus>& status, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_visible_json(status, head)
                                      : write_occlusion_binary(status, head).to_string();
}
const std::vector<RayStatus>& statuses(const HitColumns& blockers) {
  return blockers.status;
}
const std::vector<RayStatus>& statuses(const std::vector<RayStatus>& status) {
  return status;
}

/// One request on its way to its answer.
struct Look {
  Api& api;
  std::uint64_t version;
  const proto::RayOptions& options;
  ReplyFormat format;
  const Cancellation& cancellation;
  Timing& timing;
};

template <class Answer>
HttpResponse reply(const Look& look, const Result<Answer>& answer) {
  const double trace_ms = look.timing.mark("trace");
  if (!answer)
    return problem_response(problem_of(answer.error(), proto::ErrorContext::kQuery, look.cancellation));
  look.api.metrics.count_rays(statuses(*answer).size(), trace_ms);
  proto::ReplyHead head{look.version, look.options.fields, std::nullopt};
  if (look.options.stats == proto::StatsMode::kOn)
    head.stats = proto::count_statuses(statuses(*answer), trace_ms);
  std::string body = encode(*answer, head, look.format);
  look.timing.mark("encode");
  return columns_response(std::move(body), look.format, look.version, look.timing);
}

HttpResponse look_between(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const auto pairs = proto::parse_visibility_request(request.header("content-type"), request.body,
                                                     request.query, api.limits);
  if (!pairs) return problem_response(pairs.problem());
  const auto format = reply_format(request);
  if (!format) return not_acceptable();
  const proto::RayOptions& options = pairs->options;
  if (options.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*options.deadline_ms));
  timing.mark("parse");
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  const scene::VisibilityOptions how{{options.precision, options.fields, cancellation.token(), {}, nullptr},
                                     pairs->margin};
  const Look look{api, scene.version(), options, *format, cancellation, timing};
  if (pairs->blocker == proto::BlockerMode::kNone) return reply(look, blocked(scene, pairs->batch(), how));
  return reply(look, first_blockers(scene, pairs->batch(), how));
}

}  // namespace

void add_visibility_routes(Router& router, Api& api) {
  router.add({"POST",
              "/v1/scenes/{s}/visibility",
              {{std::string(proto::kJsonMediaType), api.limits.json_bytes},
               {std::string(proto::kPairsMediaType), api.limits.binary_bytes}},
              [&api](const HttpRequest& r, Cancellation& c) { return look_between(api, r, c); }});
}

}  // namespace gridcast::server
