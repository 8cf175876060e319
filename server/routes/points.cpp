#include "core/scene/points.h"

#include "proto/media_type.h"
#include "proto/point_reply.h"
#include "proto/point_request.h"
#include "server/access/caller.h"
#include "server/http/problem.h"
#include "server/routes/api.h"
#include "server/routes/reply_format.h"

namespace gridcast::server {
namespace {

using proto::PointQuestion;
using proto::Problem;

std::string encode(const NearestColumns& nearest, const proto::ReplyHead& head, proto::PointField fields,
                   ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_nearest_json(nearest, head, fields)
                                      : write_nearest_binary(nearest, head, fields).to_string();
}
std::string encode(const InsideColumns& inside, const proto::ReplyHead& head, proto::PointField fields,
                   ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_inside_json(inside, head, fields)
                                      : write_inside_binary(inside, head, fields).to_string();
}

template <class Answer>
HttpResponse reply(const Result<Answer>& answer, std::uint64_t version, proto::PointField fields,
                   ReplyFormat format, const Cancellation& cancellation, Timing& timing) {
  timing.mark("search");
  if (!answer) return problem_response(problem_of(answer.error(), proto::ErrorContext::kQuery, cancellation));
  std::string body = encode(*answer, {version, HitField::kAll, std::nullopt}, fields, format);
  timing.mark("encode");
  return columns_response(std::move(body), format, version, timing);
}

HttpResponse look_at_points(Api& api, const HttpRequest& request, Cancellation& cancellation,
                            PointQuestion question) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  const auto points = proto::parse_point_request(request.header("content-type"), request.body, request.query,
                                                 api.limits, question);
  if (!points) return problem_response(points.problem());
  const auto format = reply_format(request);
  if (!format) return not_acceptable();
  if (points->deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*points->deadline_ms));
  if (const auto problem = access::charge_rays(request, double(points->batch().size())))
    return problem_response(*problem);
  timing.mark("parse");
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  if (question == PointQuestion::kClosest) {
    const scene::NearestOptions options{points->max_distance, cancellation.token(), {}, points->mask};
    return reply(nearest_points(scene, points->batch(), options), scene.version(), points->fields, *format,
                 cancellation, timing);
  }
  const scene::InsideOptions options{
      *format == ReplyFormat::kJson ? api.limits.json_hits : api.limits.binary_hits,
      cancellation.token(),
      {},
      points->mask};
  return reply(points_inside(scene, points->batch(), options), scene.version(), points->fields, *format,
               cancellation, timing);
}

}  // namespace

void add_point_routes(Router& router, Api& api) {
  const std::vector<AcceptedBody> bodies{{std::string(proto::kJsonMediaType), api.limits.json_bytes},
                                         {std::string(proto::kPointsMediaType), api.limits.binary_bytes}};
  const auto add = [&](const char* path, PointQuestion question) {
    router.add({"POST", path, bodies, [&api, question](const HttpRequest& r, Cancellation& c) {
                  return look_at_points(api, r, c, question);
                }});
  };
  add("/v1/scenes/{s}/points/closest", PointQuestion::kClosest);
  add("/v1/scenes/{s}/points/inside", PointQuestion::kInside);
}

}  // namespace gridcast::server
