#include <array>
#include <utility>

#include "core/measure/tradeoff.h"
#include "core/scene/flatten.h"
#include "proto/media_type.h"
#include "proto/tradeoff_request.h"
#include "server/access/caller.h"
#include "server/chart/tradeoff_json.h"
#include "server/http/problem.h"
#include "server/routes/api.h"
#include "server/routes/tradeoff_forms.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

constexpr std::string_view kJobKind = "tradeoffs";

struct Extension {
  std::string_view name, media_type;
};
/// The longest of a common end first.
constexpr std::array kExtensions{
    Extension{".vl.json", proto::kVegaLiteMediaType}, Extension{".json", proto::kJsonMediaType},
    Extension{".csv", proto::kCsvMediaType}, Extension{".svg", proto::kSvgMediaType},
    Extension{".png", proto::kPngMediaType}};

/// The engine's options of a checked request, whose names cannot fail to parse.
measure::TradeoffOptions options_of(const proto::TradeoffRequest& request) {
  measure::TradeoffOptions options;
  options.classes.clear();
  for (const std::string& name : request.ray_classes)
    options.classes.push_back(*measure::parse_ray_class(name));
  for (const std::string& name : request.structures)
    options.structures.push_back(*blas::parse_structure_kind(name));
  options.precisions = request.precisions;
  options.accuracy_rays = request.accuracy_rays;
  options.speed_rays = request.speed_rays;
  options.repeat = request.repeat;
  options.threads = request.threads;
  options.seed = request.seed;
  return options;
}

/// Why this scene cannot be measured so; known before any work.
std::optional<Problem> refuse_scene(const scene::Scene& scene, const measure::TradeoffOptions& options,
                                    const proto::Limits& limits) {
  if (scene.bounds().empty())
    return Problem{ProblemCode::kInvalidValue, "the scene has no triangle that a ray could hit", ""};
  if (scene.stored_triangle_count() + scene.instance_count() > limits.tradeoff_triangles)
    return Problem{ProblemCode::kLimitExceeded,
                   "a scene to be measured may have at most " + std::to_string(limits.tradeoff_triangles) +
                       " triangles and instances",
                   ""};
  if (options.structures == std::vector{blas::StructureKind::kBruteForce} &&
      scene.world_triangle_count() > measure::kMaxBruteForceTriangles)
    return Problem{ProblemCode::kInvalidValue,
                   "brute force is measured on scenes of at most " +
                       std::to_string(measure::kMaxBruteForceTriangles) + " triangles",
                   "/structures"};
  return std::nullopt;
}

/// Counts what other work held places of the gates since it was made. For a job, which holds one itself.
class OtherWork {
 public:
  explicit OtherWork(const Api& api)
      : api_(api), gone_before_(api.gate.counts().left + api.update_gate.counts().left) {}

  [[nodiscard]] std::uint64_t count() const {
    return api_.gate.counts().entered + api_.update_gate.counts().entered - gone_before_ - 1;
  }

 private:
  const Api& api_;
  std::uint64_t gone_before_;
};

/// All that one job needs, and the place that keeps a second measurement out while this one waits or works.
struct Sweep {
  std::shared_ptr<const scene::Scene> scene;
  std::string scene_id;
  measure::TradeoffOptions options;
  std::optional<double> deadline_ms;
  WorkGate::Permit place;
};

JobOutcome measure_sweep(const Api& api, const Sweep& sweep, Cancellation& cancellation,
                         const scene::ProgressCallback& progress) {
  if (sweep.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*sweep.deadline_ms));
  const OtherWork other_work(api);
  measure::TradeoffOptions options = sweep.options;
  options.stop = cancellation.token();
  const auto report = measure::measure_tradeoffs(scene::flattened(*sweep.scene), options, progress);
  if (!report) return problem_of(report.error(), proto::ErrorContext::kQuery, cancellation);
  const std::uint64_t others = other_work.count();
  auto json = tradeoff_json(*report, sweep.scene_id);
  json["run"] = {{"scene_version", std::to_string(sweep.scene->version())},
                 {"other_work", others},
                 {"contended", others > 0}};
  HttpResponse response{200, std::string(proto::kJsonMediaType), json.dump(), {}};
  response.other_forms = tradeoff_forms(*report, sweep.scene_id);
  return response.with("Scene-Version", std::to_string(sweep.scene->version()));
}

HttpResponse post_tradeoffs(Api& api, const HttpRequest& request, const Cancellation& cancellation) {
  if (const auto problem = proto::check_query(request.query, {proto::kAtVersion}))
    return problem_response(*problem);
  const auto opened = open_scene(api, request);
  if (const auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const OpenScene& open = std::get<OpenScene>(opened);
  const auto parsed = proto::parse_tradeoff_request(request.body, api.threads, api.limits);
  if (!parsed) return problem_response(parsed.problem());
  measure::TradeoffOptions options = options_of(*parsed);
  if (const auto problem = refuse_scene(*open.scene, options, api.limits)) return problem_response(*problem);
  if (const auto problem = access::charge_rays(request, double(traces(*parsed))))
    return problem_response(*problem);
  auto place = api.tradeoff_gate.try_enter();
  if (!place)
    return problem_response(
        {ProblemCode::kTooManyJobs, "another measurement waits or is at work; there is one at a time", ""});
  // Work is kept as a copyable function, a place is not.
  auto sweep = std::make_shared<const Sweep>(
      Sweep{open.scene, open.named->id(), std::move(options), parsed->deadline_ms, *std::move(place)});
  return answer_with_job(api, request, cancellation,
                         {std::string(kJobKind), open.named->id(), open.scene->version()},
                         [&api, sweep](Cancellation& job, const scene::ProgressCallback& progress) {
                           return measure_sweep(api, *sweep, job, progress);
                         });
}

/// .../tradeoffs/{job}, with an extension to choose the form in place of Accept.
HttpResponse get_tradeoffs(Api& api, const HttpRequest& request, const Cancellation& cancellation) {
  if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
  std::string id = request.capture("t");
  std::string accept = request.header("accept");
  for (const Extension& extension : kExtensions) {
    if (!id.ends_with(extension.name)) continue;
    id.resize(id.size() - extension.name.size());
    accept = extension.media_type;
    break;
  }
  const auto job = api.jobs.find(id);
  if (!job || !access::sees_job_of(request, job->subject().owner) || job->subject().kind != kJobKind ||
      job->subject().scene != request.capture("s"))
    return problem_response(
        {ProblemCode::kJobNotFound, "there is no such measurement of this scene, or it is forgotten", ""});
  return result_response(api, *job, accept, cancellation);
}

}  // namespace

void add_tradeoff_routes(Router& router, Api& api) {
  const std::string all = "/v1/scenes/{s}/tradeoffs";
  router.add({"POST",
              all,
              {{std::string(proto::kJsonMediaType), api.limits.json_bytes}},
              [&api](const HttpRequest& r, const Cancellation& c) { return post_tradeoffs(api, r, c); }});
  router.add({"GET", all + "/{t}", {}, [&api](const HttpRequest& r, const Cancellation& c) {
                return get_tradeoffs(api, r, c);
              }});
}

}  // namespace gridcast::server
