#include "proto/media_type.h"
#include "proto/render_request.h"
#include "server/access/caller.h"
#include "server/http/problem.h"
#include "server/picture.h"
#include "server/routes/api.h"

namespace gridcast::server {
namespace {

using proto::Problem;

/// A checked request, and the one snapshot that it draws.
struct Picture {
  std::shared_ptr<const scene::Scene> scene;
  render::RenderSettings settings;
  proto::ImageFormat format = proto::ImageFormat::kPng;
  std::optional<double> deadline_ms;
};

std::variant<Picture, Problem> parse(const Api& api, const HttpRequest& request,
                                     std::shared_ptr<const scene::Scene> scene,
                                     const Cancellation& cancellation) {
  auto parsed = proto::parse_render_request(request.body, request.header("accept"), api.limits);
  if (!parsed) return parsed.problem();
  auto settings = render_settings(*scene, *parsed);
  if (!settings) return problem_of(settings.error(), proto::ErrorContext::kQuery, cancellation);
  return Picture{std::move(scene), *std::move(settings), parsed->format, parsed->deadline_ms};
}

void apply_deadline(const Picture& picture, Cancellation& cancellation) {
  if (picture.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*picture.deadline_ms));
}

JobOutcome draw(Api& api, const Picture& picture, const Cancellation& cancellation, Timing timing,
                const scene::ProgressCallback& progress) {
  const auto failed = [&](const Error& error) {
    return problem_of(error, proto::ErrorContext::kQuery, cancellation);
  };
  const auto film = render::render(*picture.scene, picture.settings, cancellation.token(), progress);
  if (!film) return failed(film.error());
  timing.mark("trace");
  const auto bytes = encode_picture(*film, picture.format, cancellation.token());
  if (!bytes) return failed(bytes.error());
  timing.mark("encode");
  api.metrics.count_pixels(std::size_t(film->width_px) * std::size_t(film->height_px));
  HttpResponse response{200,
                        std::string(media_type(picture.format)),
                        std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()),
                        {}};
  return response.with("Scene-Version", std::to_string(picture.scene->version()))
      .with("Server-Timing", timing.header());
}

HttpResponse post_render(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const OpenScene& open = std::get<OpenScene>(opened);
  auto parsed = parse(api, request, open.scene, cancellation);
  if (auto* problem = std::get_if<Problem>(&parsed)) return problem_response(*problem);
  Picture& picture = std::get<Picture>(parsed);
  const render::RenderSettings& settings = picture.settings;
  const double rays = double(settings.width_px) * double(settings.height_px) * double(settings.samples);
  if (const auto problem = access::charge_rays(request, rays)) return problem_response(*problem);
  timing.mark("parse");
  if (wants_job(request)) {
    return answer_with_job(api, request, cancellation, {"render", open.named->id(), open.scene->version()},
                           [&api, picture = std::move(picture)](Cancellation& job, const auto& progress) {
                             apply_deadline(picture, job);
                             return draw(api, picture, job, Timing(), progress);
                           });
  }
  apply_deadline(picture, cancellation);
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  JobOutcome outcome = draw(api, picture, cancellation, timing, {});
  if (const auto* problem = std::get_if<Problem>(&outcome)) return problem_response(*problem);
  return std::get<HttpResponse>(std::move(outcome));
}

}  // namespace

void add_render_routes(Router& router, Api& api) {
  router.add({"POST",
              "/v1/scenes/{s}/renders",
              {{std::string(proto::kJsonMediaType), api.limits.json_bytes}},
              [&api](const HttpRequest& r, Cancellation& c) { return post_render(api, r, c); }});
}

}  // namespace gridcast::server
