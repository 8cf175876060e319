#include "server/cli/serve_options.h"

#include <array>

#include <arpa/inet.h>

#include "server/memory_budget.h"
#include "server/scene_store.h"

namespace gridcast::server {
namespace {

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
  add("--max-explain-steps", limits.explain_steps, "Steps of a ray's explanation");
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
  app.add_option(
         "--memory-budget", limits.memory_budget_bytes,
         "Bytes that the process may hold: uploads and large answers are refused at 85 %, all new work "
         "at 95 %; 0 = no budget. The default is what the machine or the container has")
      ->capture_default_str()
      ->group(group);
  app.add_option("--keep-versions", limits.kept_versions,
                 "Versions of a scene that can be asked for by number, the newest among them; at 70 % of the "
                 "memory budget the older ones go")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000))
      ->group(group);
  app.add_option(
         "--log-bytes", limits.log_bytes,
         "Updates of a scene that its log tells, in bytes of memory; the oldest go first, all of them "
         "at 70 % of the memory budget; 0 = no log")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber)
      ->group(group);
  add("--max-event-streams", limits.event_streams,
      "Streams of events at once; at most a quarter of the connections");
  add("--max-heavy-requests", limits.heavy_requests,
      "Questions about many rays, at work or waiting, that are never too many; by default 8 for each core");
  add("--heavy-wait-ms", limits.heavy_wait_ms,
      "Beyond those, questions are refused when all together would take longer than this");
  add("--max-long-requests", limits.long_requests,
      "Uploads, and pictures that are waited for, at once; at most half of the connections");
}

void add_storage_options(CLI::App& app, ServeOptions& options) {
  const char* group = "Storage";
  CLI::Option* folder =
      app.add_option("--data-dir", options.data_folder,
                     "Folder that keeps the scenes: they survive restarts, crashes and power "
                     "loss; made when missing")
          ->group(group);
  app.add_flag("--ephemeral", options.ephemeral, "Keep scenes in memory alone, nothing on disk (the default)")
      ->excludes(folder)
      ->group(group);
  app.add_option("--compact-bytes", options.archive.log_bytes,
                 "Updates of a scene that are folded into a new snapshot when they take more than this and "
                 "than its last snapshot")
      ->capture_default_str()
      ->needs(folder)
      ->group(group);
  app.add_option(
         "--cache-bytes", options.archive.trees.bytes,
         "Built trees in the folder, all together, so that a restart need not build them; those that were "
         "used longest ago go first; 0 = none")
      ->capture_default_str()
      ->needs(folder)
      ->group(group);
}

void add_connection_options(CLI::App& app, ServeOptions& options) {
  HttpServerOptions& http = options.http;
  app.add_option("--max-connections", http.connection_threads, "Connections served at once")
      ->capture_default_str()
      ->check(CLI::Range(1, 4096));
  app.add_option("--max-queued-connections", http.max_queued_connections,
                 "Connections that may wait for one of them")
      ->capture_default_str()
      ->check(CLI::Range(0, 65536));
  app.add_option(
         "--max-connections-per-address", options.connections_per_address,
         "Connections that one address may have at once (of IPv6, one network of 64 bits); 0 = no limit. "
         "Without it 128 on a --host that others reach, else none: all are one machine then. Behind a "
         "proxy, whose address all have, 0")
      ->check(CLI::Range(0, 65536));
  app.add_option("--max-waiting-connections", http.max_waiting_connections,
                 "Connections whose request has not come yet; beyond, the slowest is closed")
      ->capture_default_str()
      ->check(CLI::Range(1, 65536));
}

void add_access_options(CLI::App& app, ServeOptions& options) {
  const char* group = "Access";
  app.add_option("--tokens", options.tokens_file,
                 "File of the tokens that are served ('gridcast token new' makes one); SIGHUP reads it again")
      ->group(group);
  app.add_flag("--allow-public", options.allow_public,
               "Allow a --host that is not a loopback address; with --tokens, or")
      ->group(group);
  app.add_flag("--without-access-control", options.without_access_control,
               "with this: whoever reaches the public address may do everything")
      ->group(group);
}

}  // namespace

void add_serve_options(CLI::App& app, ServeOptions& options) {
  options.limits.memory_budget_bytes = available_memory_bytes();
  app.add_option("--host", options.http.host, "Address to listen on")->capture_default_str();
  app.add_option("--port", options.http.port, "Port; 0 = any free one")
      ->capture_default_str()
      ->check(CLI::Range(0, 65535));
  app.add_option("--load", options.load, "Load a scene before serving: NAME=FILE.glb (repeatable)");
  add_storage_options(app, options);
  app.add_option("--threads", options.threads, "Threads for builds, rays and pictures; 0 = every core")
      ->capture_default_str()
      ->check(CLI::Range(0, 4096));
  app.add_flag("--import-in-process", options.import_in_process,
               "Parse uploaded models in this process, not in one of their own that may do nothing else");
  add_connection_options(app, options);
  add_limit_options(app, options.limits);
  app.add_option("--log-level", options.log_level, "debug, info, warning, error or off")
      ->capture_default_str()
      ->check(CLI::IsMember({"debug", "info", "warning", "error", "off"}));
  app.add_option("--log-format", options.log_format, "text or json")
      ->capture_default_str()
      ->check(CLI::IsMember({"text", "json"}));
  add_access_options(app, options);
}

bool is_loopback(const std::string& host) {
  std::array<unsigned char, 4> address{};
  if (::inet_pton(AF_INET, host.c_str(), address.data()) == 1) return address[0] == 127;
  return host == "localhost" || host == "::1";
}

std::string complain_about(const ServeOptions& options) {
  if (!is_loopback(options.http.host) && !options.allow_public)
    return "--host " + options.http.host + " can be reached by others; add --allow-public if that is meant";
  if (!is_loopback(options.http.host) && options.tokens_file.empty() && !options.without_access_control)
    return "--allow-public lets others in: name who with --tokens FILE, or add --without-access-control if "
           "anybody may change and delete every scene";
  if (!options.tokens_file.empty() && options.without_access_control)
    return "--tokens and --without-access-control exclude each other";
  for (const std::string& item : options.load)
    if (item.find('=') == item.npos || !SceneStore::is_valid_id(item.substr(0, item.find('='))))
      return "--load takes NAME=FILE, NAME of letters, digits, '_', '.' and '-'";
  return {};
}

}  // namespace gridcast::server
