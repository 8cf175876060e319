#include "core/scene/explain.h"

#include "proto/explain_reply.h"
#include "proto/explain_request.h"
#include "proto/media_type.h"
#include "server/access/caller.h"
#include "server/http/problem.h"
#include "server/routes/reply_format.h"

namespace gridcast::server {
namespace {

using proto::Problem;

HttpResponse explain_ray(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const auto asked = proto::parse_explain_request(request.body, request.query, api.limits);
  if (!asked) return problem_response(asked.problem());
  if (asked->deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*asked->deadline_ms));
  if (const auto problem = access::charge_rays(request, 1.0)) return problem_response(*problem);
  timing.mark("parse");
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  const auto told =
      explain(scene, asked->ray,
              {asked->precision, asked->excluded, asked->max_steps, cancellation.token(), asked->mask});
  const double trace_ms = timing.mark("trace");
  if (!told) return problem_response(problem_of(told.error(), proto::ErrorContext::kQuery, cancellation));
  api.metrics.count_rays(1, trace_ms);
  std::string body =
      proto::write_explain_json({scene.version(), told->hit, told->counts, told->steps, told->is_truncated});
  timing.mark("encode");
  return columns_response(std::move(body), ReplyFormat::kJson, scene.version(), timing);
}

}  // namespace

void add_explain_routes(Router& router, Api& api) {
  router.add({"POST",
              "/v1/scenes/{s}/explain",
              {{std::string(proto::kJsonMediaType), api.limits.json_bytes}},
              [&api](const HttpRequest& r, Cancellation& c) { return explain_ray(api, r, c); }});
}

}  // namespace gridcast::server
