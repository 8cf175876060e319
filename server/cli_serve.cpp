#include <algorithm>
#include <atomic>
#include <cstdio>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <malloc.h>

#include "server/api.h"
#include "server/cli_common.h"
#include "server/http_server.h"
#include "server/load.h"
#include "server/log.h"
#include "server/signals.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
Prints 'listening on http://HOST:PORT' on stdout once it does. The contract is at /openapi.json, probes at
/healthz/live and /healthz/ready, Prometheus' metrics at /metrics. Ctrl-C or SIGTERM lets requests at work finish;
a second one ends at once.

With --data-dir an upload, an update or a deletion is answered when it is on disk: no crash and no loss of power takes
it back. Jobs are not kept. One server has one data folder. Without it scenes go when the program ends.

There is no authentication yet: whoever reaches the port may do everything. It listens on the loopback address
unless --allow-public is given as well.

Examples:
  gridcast serve --port 8080 --load engine=engine.glb
  gridcast serve --port 8080 --data-dir /var/lib/gridcast
  curl -s --data-binary @engine.glb -H 'Content-Type: model/gltf-binary' 'http://127.0.0.1:8080/v1/scenes?name=engine'
  curl -s http://127.0.0.1:8080/v1/scenes/engine/rays/closest -H 'Content-Type: application/json' \
       -d '{"origins": [[0,0,900]], "directions": [[0,0,-1]]}')";

bool is_loopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host.rfind("127.", 0) == 0;
}

struct ServeOptions {
  HttpServerOptions http;
  proto::Limits limits;
  std::size_t threads = 0;
  std::vector<std::string> load;  ///< NAME=FILE
  std::string log_level = "info";
  std::string log_format = "text";
  bool allow_public = false;
  std::string data_folder;  ///< empty: scenes live in memory alone
  bool ephemeral = false;
  store::ArchiveOptions archive;
};

/// Large blocks go back to the system when they are freed, and many threads share a few heaps: else memory of
/// refused and deleted scenes would stay with us.
void return_freed_memory() {
  ::mallopt(M_ARENA_MAX, 4);
  ::mallopt(M_MMAP_THRESHOLD, 256 * 1024);
  ::mallopt(M_TRIM_THRESHOLD, 1024 * 1024);
}

void add_limit_options(CLI::App& app, proto::Limits& limits) {
  const char* group = "Limits (published at GET /v1)";
  const auto add = [&](const char* flag, auto& value, const char* help) {
    app.add_option(flag, value, help)->capture_default_str()->check(CLI::PositiveNumber)->group(group);
  };
  add("--max-json-bytes", limits.json_bytes, "A JSON body");
  add("--max-json-rays", limits.json_rays, "Rays in a JSON body");
  add("--max-json-hits", limits.json_hits, "Hits in a JSON answer of rays/all");
  add("--max-binary-hits", limits.binary_hits, "Hits in a binary answer of rays/all");
  add("--max-binary-bytes", limits.binary_bytes, "A binary body");
  add("--max-binary-rays", limits.binary_rays, "Rays in a binary body");
  add("--max-glb-bytes", limits.glb_bytes, "A model");
  add("--max-image-side", limits.image_side_px, "Pixels of a picture's side");
  add("--max-image-samples", limits.image_samples, "Width x height x samples of a picture");
  add("--max-tradeoff-triangles", limits.tradeoff_triangles,
      "Triangles and instances of a scene to be measured");
  add("--max-tradeoff-accuracy-rays", limits.tradeoff_accuracy_rays, "Rays of a class that are compared");
  add("--max-tradeoff-speed-rays", limits.tradeoff_speed_rays, "Rays of a class that are timed");
  add("--max-tradeoff-repeat", limits.tradeoff_repeat, "Timings of a class");
  add("--max-tradeoff-traces", limits.tradeoff_traces, "Rays that one measurement traces in all");
  add("--max-scenes", limits.scenes, "Scenes at once");
  add("--deadline-ms", limits.deadline_ms, "A request's work, the wait in the queue included");
  add("--max-queued-jobs", limits.jobs_queued, "Jobs that may wait");
  add("--max-kept-jobs", limits.jobs_kept, "Ended jobs that can be asked for");
  add("--max-job-result-bytes", limits.job_result_bytes, "Results of ended jobs, all together");
  add("--job-keep-ms", limits.job_keep_ms, "How long an ended job is kept");
  add("--job-deadline-ms", limits.job_deadline_ms, "A job's work, without the wait in the queue");
  add("--max-idempotency-keys", limits.idempotency_keys, "Answers kept for those who ask again");
  add("--max-idempotency-bytes", limits.idempotency_bytes, "Of all of them together");
  add("--idempotency-keep-ms", limits.idempotency_keep_ms, "How long such an answer is kept");
  add("--max-event-streams", limits.event_streams,
      "Streams of events at once; at most a quarter of the connections");
}

class ServeCommand final : public Command {
 public:
  explicit ServeCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    app.add_option("--host", options_.http.host, "Address to listen on")->capture_default_str();
    app.add_option("--port", options_.http.port, "Port; 0 = any free one")
        ->capture_default_str()
        ->check(CLI::Range(0, 65535));
    app.add_option("--load", options_.load, "Load a scene before serving: NAME=FILE.glb (repeatable)");
    add_storage_options(app);
    app.add_option("--threads", options_.threads, "Threads for builds, rays and pictures; 0 = every core")
        ->capture_default_str()
        ->check(CLI::Range(0, 4096));
    app.add_option("--max-connections", options_.http.connection_threads, "Connections served at once")
        ->capture_default_str()
        ->check(CLI::Range(1, 4096));
    app.add_option("--max-queued-connections", options_.http.max_queued_connections,
                   "Connections that may wait")
        ->capture_default_str()
        ->check(CLI::Range(0, 65536));
    add_limit_options(app, options_.limits);
    app.add_option("--log-level", options_.log_level, "debug, info, warning, error or off")
        ->capture_default_str()
        ->check(CLI::IsMember({"debug", "info", "warning", "error", "off"}));
    app.add_option("--log-format", options_.log_format, "text or json")
        ->capture_default_str()
        ->check(CLI::IsMember({"text", "json"}));
    app.add_flag("--allow-public", options_.allow_public, "Allow a --host that is not a loopback address");
  }

  int run(const std::stop_token& stop) override {
    if (!is_loopback(options_.http.host) && !options_.allow_public) {
      std::fprintf(stderr,
                   "gridcast: --host %s can be reached by others and there is no authentication; "
                   "add --allow-public if that is meant\n",
                   options_.http.host.c_str());
      return kExitUsage;
    }
    for (const std::string& item : options_.load) {
      if (item.find('=') != item.npos && SceneStore::is_valid_id(item.substr(0, item.find('=')))) continue;
      std::fprintf(stderr, "gridcast: --load takes NAME=FILE, NAME of letters, digits, '_', '.' and '-'\n");
      return kExitUsage;
    }
    start_log(options_.log_level, options_.log_format == "json" ? LogFormat::kJson : LogFormat::kText);
    if (!is_loopback(options_.http.host)) log_warning("listening on a public address without authentication");
    return_freed_memory();
    const ThreadLimit limit(options_.threads);
    // Each stream holds a connection's thread: most of them stay free for requests.
    options_.limits.event_streams = std::min(options_.limits.event_streams,
                                             std::max<std::size_t>(1, options_.http.connection_threads / 4));
    auto archive = open_archive();
    if (!archive) return report("serve", archive.error());
    const bool is_empty = *archive == nullptr && options_.load.empty();
    Api api(options_.limits, limit.threads(), std::move(archive).value());
    std::atomic<bool> loaded{is_empty};
    api.ready = [&] { return loaded && !stop.stop_requested(); };
    return serve(api, loaded, stop);
  }

 private:
  void add_storage_options(CLI::App& app) {
    const char* group = "Storage";
    CLI::Option* folder =
        app.add_option("--data-dir", options_.data_folder,
                       "Folder that keeps the scenes: they survive restarts, crashes and power "
                       "loss; made when missing")
            ->group(group);
    app.add_flag("--ephemeral", options_.ephemeral,
                 "Keep scenes in memory alone, nothing on disk (the default)")
        ->excludes(folder)
        ->group(group);
    app.add_option("--compact-bytes", options_.archive.log_bytes,
                   "Updates of a scene that are folded into a new snapshot when they take more than this and "
                   "than its last snapshot")
        ->capture_default_str()
        ->needs(folder)
        ->group(group);
  }

  /// Null for scenes in memory alone.
  Result<std::unique_ptr<store::SceneArchive>> open_archive() const {
    if (!options_.data_folder.empty())
      return store::SceneArchive::open(options_.data_folder, options_.archive);
    if (!options_.ephemeral) log_info("scenes live in memory alone; --data-dir DIR keeps them");
    return std::unique_ptr<store::SceneArchive>();
  }

  int serve(Api& api, std::atomic<bool>& loaded, const std::stop_token& stop) {
    options_.http.deadline = std::chrono::milliseconds(std::int64_t(options_.limits.deadline_ms));
    HttpServer http(make_router(api), options_.http, [&api](const RequestRecord& record) {
      api.metrics.count_request(record);
      log_request(record);
    });
    api.requests_in_flight = [&http] { return http.requests_in_flight(); };
    const Result<int> port = http.bind();
    if (!port) return report("serve", port.error());
    const bool is_v6 = options_.http.host.find(':') != std::string::npos;
    std::printf(is_v6 ? "listening on http://[%s]:%d\n" : "listening on http://%s:%d\n",
                options_.http.host.c_str(), *port);
    std::fflush(stdout);
    // The probes answer while scenes load; /healthz/ready turns when all are there.
    std::atomic<int> code{kExitDone};
    std::thread loader([&] {
      code = load_all(api, stop);
      loaded = true;
      if (code != kExitDone) http.stop();
    });
    const std::stop_callback on_signal(stop, [&http, &api] {
      http.stop();
      api.jobs.shut_down();
      api.trees.shut_down();
    });
    http.serve();
    loader.join();
    log_info("stopped");
    return stop.stop_requested() ? kExitDone : code.load();
  }

  int load_all(Api& api, const std::stop_token& stop) {
    if (api.archive) {
      api.store.restore(stop, [](const DamagedScene& scene) { log_error("not served: " + scene.detail); });
      log_info("restored " + std::to_string(api.store.list().size()) + " scenes");
    }
    for (const std::string& item : options_.load) {
      const std::size_t equals = item.find('=');
      const std::string name = item.substr(0, equals);
      if (api.archive && api.store.find(name) != nullptr) {
        log_info("kept " + name + " as it is stored");
        continue;
      }
      LoadOptions load;
      load.stop = stop;
      auto scene = load_scene_file(item.substr(equals + 1), load);
      if (!scene) return report(item.substr(equals + 1), scene.error());
      auto created = api.store.create(name, scene->scene, {"auto", scene->import_ms, scene->build_ms});
      if (const auto* problem = std::get_if<proto::Problem>(&created))
        return report(name, Error{ErrorCode::kConflict, problem->detail, "--load"});
      log_info("loaded " + name);
    }
    return kExitDone;
  }

  ServeOptions options_;
};

}  // namespace

std::unique_ptr<Command> make_serve_command(CLI::App& program) {
  return std::make_unique<ServeCommand>(*program.add_subcommand("serve", "Serve scenes over HTTP"));
}

}  // namespace gridcast::server
