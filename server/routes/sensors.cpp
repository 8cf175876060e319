#include <numbers>

#include "core/render/camera.h"
#include "core/scene/made_rays.h"
#include "core/sensor/noise.h"
#include "core/sensor/pattern.h"
#include "proto/media_type.h"
#include "proto/sensor_request.h"
#include "server/access/caller.h"
#include "server/routes/ray_reply.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::SensorRequest;

double radians(double degrees) {
  return degrees * (std::numbers::pi / 180.0);
}

Result<Affine> pose_of(const proto::SensorPose& pose) {
  if (const auto* transform = std::get_if<Affine>(&pose)) return *transform;
  const auto& look = std::get<proto::LookAtPose>(pose);
  constexpr double kAnyAngle = 1.0;
  const auto camera = render::look_at(look.eye, look.target, look.up, kAnyAngle);
  if (!camera) return Error{camera.error().code, camera.error().message, "/pose" + camera.error().where};
  return camera->world_from_camera;
}

Result<sensor::Sensor> sensor_of(const SensorRequest& request) {
  const auto pose = pose_of(request.pose);
  if (!pose) return pose.error();
  sensor::Sensor made{*pose, sensor::Pinhole{}, request.max_range};
  if (request.type == "pinhole") {
    made.model = sensor::Pinhole{request.width_px, request.height_px, radians(request.yfov_deg)};
  } else if (request.type == "orthographic") {
    made.model = sensor::Orthographic{request.width_px, request.height_px, request.height};
  } else if (request.type == "fisheye") {
    made.model = sensor::Fisheye{request.width_px, request.height_px, radians(request.fov_deg)};
  } else if (request.type == "grid") {
    made.model = sensor::Grid{request.columns, request.rows, request.x_spacing, request.y_spacing};
  } else {
    sensor::Lidar lidar{
        {}, radians(request.azimuth_from_deg), radians(request.azimuth_step_deg), request.azimuth_count};
    for (const double elevation : request.elevations_deg) lidar.elevations_rad.push_back(radians(elevation));
    made.model = std::move(lidar);
  }
  if (const Status good = sensor::check(made); !good) return good.error();
  return made;
}

/// The answer's rays are limited as those of a question are in binary, and by the hits that JSON may have.
std::optional<Problem> check_count(std::size_t count, ReplyFormat format, const proto::Limits& limits) {
  const std::size_t most = format == ReplyFormat::kJson ? limits.json_hits : limits.binary_rays;
  if (count > 0 && count <= most) return std::nullopt;
  return Problem{proto::ProblemCode::kTooManyRays,
                 "a sensor has 1 to " + std::to_string(limits.binary_rays) +
                     " rays, answered in JSON at most " + std::to_string(limits.json_hits),
                 ""};
}

HttpResponse measure(const scene::Scene& scene, const SensorRequest& request, const sensor::Sensor& sensor,
                     const RayReply& to) {
  const scene::MadeRays rays{ray_count(sensor), [&](std::size_t i) { return sensor::ray(sensor, i); }};
  const sensor::RangeNoise noise{request.noise_sigma, request.noise_seed};
  const auto disturbed = [&](auto answer) {
    if (answer && noise.sigma_m > 0.0) add_noise(noise, *answer);
    return answer;
  };
  if (request.max_returns > 1) {
    scene::AllHitsOptions options;
    options.precision = request.options.precision;
    options.fields = request.options.fields;
    options.max_hits = request.max_returns;
    options.max_total_hits =
        to.format == ReplyFormat::kJson ? to.api.limits.json_hits : to.api.limits.binary_hits;
    options.stop = to.cancellation.token();
    options.mask = request.options.mask;
    return reply(to, disturbed(intersect_all(scene, rays, options)), nullptr);
  }
  scene::TraceStats traced;
  const scene::TraceOptions options{
      request.options.precision, request.options.fields, to.cancellation.token(), {}, &traced,
      request.options.mask};
  return reply(to, disturbed(intersect(scene, rays, options)), &traced);
}

HttpResponse use_sensor(Api& api, const HttpRequest& request, Cancellation& cancellation) {
  Timing timing;
  auto opened = open_scene(api, request);
  if (auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const auto parsed = proto::parse_sensor_request(request.body, request.query, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  const auto format = reply_format(request);
  if (!format) return not_acceptable();
  const auto sensor = sensor_of(*parsed);
  if (!sensor) return problem_response(problem_of(sensor.error(), proto::ErrorContext::kQuery, cancellation));
  if (const auto problem = check_count(ray_count(*sensor), *format, api.limits))
    return problem_response(*problem);
  if (parsed->options.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*parsed->options.deadline_ms));
  if (const auto problem = access::charge_rays(request, double(ray_count(*sensor))))
    return problem_response(*problem);
  timing.mark("parse");
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));
  timing.mark("wait");
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  return measure(scene, *parsed, *sensor,
                 {api, scene.version(), parsed->options, *format, cancellation, timing});
}

}  // namespace

void add_sensor_routes(Router& router, Api& api) {
  router.add({"POST",
              "/v1/scenes/{s}/sensors",
              {{std::string(proto::kJsonMediaType), api.limits.json_bytes}},
              [&api](const HttpRequest& r, Cancellation& c) { return use_sensor(api, r, c); }});
}

}  // namespace gridcast::server
