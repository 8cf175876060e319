#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <malloc.h>

#include "server/access/access_control.h"
#include "server/cli/serve_options.h"
#include "server/http/http_server.h"
#include "server/load.h"
#include "server/log.h"
#include "server/routes/api.h"
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

Without --tokens whoever reaches the port may do everything; it listens on the loopback address then, unless told
otherwise twice. With it every request but the probes needs a token of the file: 'gridcast token --help' says more.
There is no TLS: on the open network put a proxy before it, as docker/compose.yaml does.

Examples:
  gridcast serve --port 8080 --load engine=engine.glb
  gridcast serve --port 8080 --data-dir /var/lib/gridcast
  gridcast serve --port 8080 --tokens tokens
  curl -s --data-binary @engine.glb -H 'Content-Type: model/gltf-binary' 'http://127.0.0.1:8080/v1/scenes?name=engine'
  curl -s http://127.0.0.1:8080/v1/scenes/engine/rays/closest -H 'Content-Type: application/json' \
       -d '{"origins": [[0,0,900]], "directions": [[0,0,-1]]}')";

/// An orderly end may take so long for trees that a restart would build otherwise.
constexpr std::chrono::seconds kTreesAtEnd{10};

/// Of strangers: twice what the server answers at once, a fraction of the connections that it keeps.
constexpr std::size_t kConnectionsPerAddress = 128;

/// Large blocks go back to the system when they are freed, and many threads share a few heaps: else memory of
/// refused and deleted scenes would stay with us.
void return_freed_memory() {
  ::mallopt(M_ARENA_MAX, 4);
  ::mallopt(M_MMAP_THRESHOLD, 256 * 1024);
  ::mallopt(M_TRIM_THRESHOLD, 1024 * 1024);
}

class ServeCommand final : public Command {
 public:
  explicit ServeCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    add_serve_options(app, options_);
  }

  int run(const std::stop_token& stop) override {
    if (const std::string complaint = complain_about(options_); !complaint.empty()) {
      std::fprintf(stderr, "gridcast: %s\n", complaint.c_str());
      return kExitUsage;
    }
    start_log(options_.log_level, options_.log_format == "json" ? LogFormat::kJson : LogFormat::kText);
    if (!is_loopback(options_.http.host)) warn_of_public_address();
    if (const Status opened = open_access(); !opened) return report("serve", opened.error());
    return_freed_memory();
    const ThreadLimit limit(options_.threads);
    // Each stream holds a connection's thread: most of them stay free for requests.
    options_.limits.event_streams = std::min(options_.limits.event_streams,
                                             std::max<std::size_t>(1, options_.http.connection_threads / 4));
    options_.limits.long_requests = std::min(options_.limits.long_requests,
                                             std::max<std::size_t>(1, options_.http.connection_threads / 2));
    options_.limits.connections_per_address = options_.connections_per_address.value_or(
        is_loopback(options_.http.host) ? 0 : kConnectionsPerAddress);
    auto archive = open_archive();
    if (!archive) return report("serve", archive.error());
    const bool is_empty = *archive == nullptr && options_.load.empty();
    Api api(options_.limits, limit.threads(), std::move(archive).value());
    if (!options_.import_in_process) api.importer = std::make_unique<ImportHelper>();
    std::atomic<bool> loaded{is_empty};
    api.ready = [&] { return loaded && !stop.stop_requested(); };
    return serve(api, loaded, stop);
  }

 private:
  void warn_of_public_address() const {
    log_warning(options_.tokens_file.empty()
                    ? "listening on a public address without access control"
                    : "listening on a public address without TLS: tokens can be read on the way");
  }

  Status open_access() {
    if (options_.tokens_file.empty()) return ok_status();
    auto access = access::AccessControl::open(options_.tokens_file);
    if (!access) return access.error();
    access_ = std::move(access).value();
    options_.http.access = access_.get();
    hangup_.emplace([this] {
      const Status read = access_->reload();
      if (read)
        log_info("read the tokens again");
      else
        log_error("kept the tokens as they were: " + read.error().message + " (" + read.error().where + ")");
    });
    return ok_status();
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
    options_.http.memory = &api.memory;
    options_.http.heavy_requests = options_.limits.heavy_requests;
    options_.http.long_requests = options_.limits.long_requests;
    options_.http.connections_per_address = options_.limits.connections_per_address;
    options_.http.heavy_wait = std::chrono::milliseconds(std::int64_t(options_.limits.heavy_wait_ms));
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
    if (api.archive) api.archive->finish(kTreesAtEnd);
    log_info("stopped");
    return stop.stop_requested() ? kExitDone : code.load();
  }

  int load_all(Api& api, const std::stop_token& stop) {
    if (api.archive) {
      api.store.restore(stop, [](const DamagedScene& scene) { log_error("not served: " + scene.detail); });
      log_info("restored " + std::to_string(api.store.list().size()) + " scenes, with " +
               std::to_string(api.archive->counts().trees.found) + " trees as they were built before");
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
  std::unique_ptr<access::AccessControl> access_;
  std::optional<HangupWatch> hangup_;
};

}  // namespace

std::unique_ptr<Command> make_serve_command(CLI::App& program) {
  return std::make_unique<ServeCommand>(*program.add_subcommand("serve", "Serve scenes over HTTP"));
}

}  // namespace gridcast::server
