#include "core/scene/visibility.h"

#include "proto/media_type.h"
#include "proto/visibility_reply.h"
#include "proto/visibility_request.h"
#include "server/access/caller.h"
#include "server/routes/ray_reply.h"

namespace gridcast::server {
namespace {

using proto::Problem;

std::string write_blockers(const HitColumns& blockers, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_blockers_json(blockers, head) : encode(blockers, head, format);
}
std::string write_visible(const std::vector<RayStatus>& status, const proto::ReplyHead& head,
                          ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_visible_json(status, head) : encode(status, head, format);
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
  if (const auto problem = access::charge_rays(request, double(pairs->batch().size())))
    return problem_response(*problem);
  timing.mark("parse");
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  scene::TraceStats traced;
  const scene::VisibilityOptions how{
      {options.precision, options.fields, cancellation.token(), {}, &traced, options.mask}, pairs->margin};
  const RayReply to{api, scene.version(), options, *format, cancellation, timing};
  if (pairs->blocker == proto::BlockerMode::kNone)
    return reply_with(to, blocked(scene, pairs->batch(), how), &traced, write_visible);
  return reply_with(to, first_blockers(scene, pairs->batch(), how), &traced, write_blockers);
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
