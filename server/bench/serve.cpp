#include "server/bench/serve.h"

#include <memory>
#include <utility>
#include <vector>

#include "core/measure/interleave.h"
#include "core/scene/trace.h"
#include "server/bench/cores_apart.h"
#include "server/bench/loopback.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

/// What is served, and how.
struct Serving {
  const measure::BenchScene& bench_scene;
  const std::shared_ptr<const scene::Scene>& scene;
  const measure::RaySet& rays;
  std::size_t threads;
  measure::ClientCores clients;
};

Status serve_set(const Serving& serving, const measure::BenchOptions& options, measure::Report& report,
                 const scene::ProgressCallback& progress) {
  const std::shared_ptr<const scene::Scene>& scene = serving.scene;
  const measure::RaySet& rays = serving.rays;
  const std::size_t threads = serving.threads;
  // The server's own threads trace, so the bound has to hold for the whole process.
  const ThreadLimit limit(threads);
  std::unique_ptr<CoresApart> apart;
  if (serving.clients == measure::ClientCores::kApart) {
    auto made = CoresApart::make(threads);
    if (!made) return made.error();
    apart = std::move(made).value();
  }
  LoopbackServer server(scene, threads);
  const Result<int> port = server.start();
  if (!port) return port.error();
  if (rays.size() > server.max_rays())
    return Error{ErrorCode::kLimitExceeded, "a batch beyond the server's limit", "/serve"};
  LoopbackClient client(*port);
  std::vector<measure::Timed> timed(2);
  timed[0].run = [&] { return client.cast(rays.batch().bytes); };
  if (apart) {
    timed[0].before = [&] { apart->be_client(); };
    timed[0].after = [&] { apart->be_server(); };
  }
  timed[1].run = [&] {
    const auto hits =
        scene::intersect(*scene, rays.batch(), {Precision::kRobust, HitField::kAll, options.stop, {}});
    return hits ? ok_status() : Status(hits.error());
  };
  if (Status status = interleave(timed, threads, measure::ClockKind::kWall, options, progress); !status)
    return status;
  measure::ServeRow row;
  row.scene = serving.bench_scene.name;
  row.set = measure::to_string(rays.kind);
  row.clients = serving.clients;
  row.threads = threads;
  row.rays = rays.size();
  row.mrays_per_s = double(rays.size()) / measure::median(timed[0].seconds) / 1e6;
  row.spread = measure::spread(timed[0].seconds);
  row.vs_in_process = measure::speedup(timed[0].seconds, timed[1].seconds);
  report.serve.push_back(row);
  return ok_status();
}

}  // namespace

Status bench_serve(const measure::BenchScene& bench_scene, const measure::BenchOptions& options,
                   measure::Report& report, const scene::ProgressCallback& progress) {
  const auto scene = scene::build_scene(bench_scene.data, {{}, options.stop, {}});
  if (!scene) return scene.error();
  const measure::RaySetMaker maker(**scene, bench_scene.view, options.rays, options.seed);
  for (const measure::RaySetKind kind : options.sets) {
    if (measure::query_of(kind) != measure::QueryKind::kClosest) continue;
    const auto rays = maker.make(kind);
    if (!rays) return rays.error();
    for (const measure::ClientCores clients : options.clients)
      for (const std::size_t threads : options.threads)
        if (Status status =
                serve_set({bench_scene, *scene, *rays, threads, clients}, options, report, progress);
            !status)
          return status;
  }
  return ok_status();
}

}  // namespace gridcast::server
