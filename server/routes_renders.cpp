#include "proto/media_type.h"
#include "proto/render_request.h"
#include "server/api.h"
#include "server/picture.h"
#include "server/problem.h"

namespace gridcast::server {
namespace {

using proto::Problem;

HttpResponse failed(const Error& error, const Cancellation& cancellation) {
  return problem_response(problem_of(error, proto::ErrorContext::kQuery, cancellation));
}

HttpResponse render_picture(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  auto parsed = proto::parse_render_request(request.body, request.header("accept"), api.limits);
  if (!parsed) return problem_response(parsed.problem());
  auto settings = render_settings(scene, *parsed);
  if (!settings) return failed(settings.error(), cancellation);
  if (parsed->deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*parsed->deadline_ms));
  timing.mark("parse");
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  const auto film = render::render(scene, *settings, cancellation.token());
  if (!film) return failed(film.error(), cancellation);
  timing.mark("trace");
  const auto bytes = encode_picture(*film, parsed->format);
  if (!bytes) return failed(bytes.error(), cancellation);
  timing.mark("encode");
  api.metrics.count_pixels(std::size_t(film->width_px) * std::size_t(film->height_px));
  HttpResponse response{200,
                        std::string(media_type(parsed->format)),
                        std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()),
                        {}};
  return response.with("Scene-Version", std::to_string(scene.version()))
      .with("Server-Timing", timing.header());
}

}  // namespace

void add_render_routes(Router& router, Api& api) {
  router.add({"POST",
              "/v1/scenes/{s}/renders",
              {{std::string(proto::kJsonMediaType), api.limits.json_bytes}},
              [&api](const HttpRequest& r, Cancellation& c) { return render_picture(api, r, c); }});
}

}  // namespace gridcast::server
