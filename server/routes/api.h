#pragma once
// What the routes share, and the few steps that most of them take.

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "proto/limits.h"
#include "server/http/http_types.h"
#include "server/http/router.h"
#include "server/import/import_helper.h"
#include "server/jobs.h"
#include "server/memory_budget.h"
#include "server/metrics.h"
#include "server/routes/kept_answers.h"
#include "server/scene_store.h"
#include "server/tree_builder.h"
#include "server/work_gate.h"

namespace gridcast::server {

struct Api {
  proto::Limits limits;
  std::unique_ptr<store::SceneArchive> archive;  ///< null: scenes live in memory alone
  TreeBuilder trees;
  SceneStore store;
  Metrics metrics;
  MemoryBudget memory;
  WorkGate gate{1};  ///< queries, builds, jobs
  /// Updates that refit or build: apart from `gate`, so that none waits for a query.
  WorkGate update_gate{1};
  /// Measurements of tradeoffs, waiting or at work: two at once would time each other.
  WorkGate tradeoff_gate{1};
  KeptAnswers kept_answers;
  std::size_t threads = 1;
  std::unique_ptr<ImportHelper> importer;  ///< of models; null: this process parses them
  std::function<std::size_t()> requests_in_flight = [] { return std::size_t(0); };
  std::function<bool()> ready = [] { return true; };
  std::atomic<std::size_t> event_streams{0};  ///< open now
  Jobs jobs;                                  // last: its workers use the rest

  Api(const proto::Limits& limits_in_force, std::size_t thread_count,
      std::unique_ptr<store::SceneArchive> scene_archive = nullptr);
};

void add_meta_routes(Router& router, Api& api);
void add_scene_routes(Router& router, Api& api);
void add_export_routes(Router& router, Api& api);
void add_mesh_routes(Router& router, Api& api);
void add_instance_routes(Router& router, Api& api);
void add_transaction_routes(Router& router, Api& api);
void add_pose_routes(Router& router, Api& api);
void add_log_routes(Router& router, Api& api);
void add_ray_routes(Router& router, Api& api);
void add_explain_routes(Router& router, Api& api);
void add_point_routes(Router& router, Api& api);
void add_visibility_routes(Router& router, Api& api);
void add_sensor_routes(Router& router, Api& api);
void add_render_routes(Router& router, Api& api);
void add_tradeoff_routes(Router& router, Api& api);
void add_job_routes(Router& router, Api& api);
[[nodiscard]] Router make_router(Api& api);

/// A scene and the one snapshot that a request works on.
struct OpenScene {
  std::shared_ptr<NamedScene> named;
  std::shared_ptr<const scene::Scene> scene;
};
/// The scene of the path's {s}, at the version that the query asks for (?at_version) or at its newest. Writes
/// refuse that parameter as one that they do not know.
[[nodiscard]] std::variant<OpenScene, proto::Problem> open_scene(const Api& api, const HttpRequest& request);

/// An id in a path: digits only, below 2^32 - 1.
[[nodiscard]] std::optional<std::uint32_t> parse_id(std::string_view text);

/// JSON about one version of a scene, with Scene-Version and ETag.
[[nodiscard]] HttpResponse versioned_json(std::string body, std::uint64_t version, int status = 200);
/// 304 when If-None-Match names `version`, 400 when it is malformed.
[[nodiscard]] std::optional<HttpResponse> not_modified(const HttpRequest& request, std::uint64_t version);

/// Server-Timing: parse;dur=1.2, wait;dur=0.1 ...
class Timing {
 public:
  /// Ends the phase that began at the last call or at construction.
  double mark(std::string_view phase);
  /// A phase that took `ms` in all, in turns with others, until now.
  void add(std::string_view phase, double ms);
  [[nodiscard]] const std::string& header() const { return header_; }

 private:
  Clock::time_point last_ = Clock::now();
  std::string header_;
};

/// Whether the client would rather have a job than wait (Prefer: respond-async).
[[nodiscard]] bool wants_job(const HttpRequest& request);
/// The result of a job that is done, in the form that `accept` (an Accept header) likes best; else why there
/// is none.
[[nodiscard]] HttpResponse result_response(Api& api, const Job& job, std::string_view accept,
                                           const Cancellation& cancellation);
/// Queues `work` and answers 202 with the job; with `Prefer: wait=SECONDS` its result when it comes in time.
[[nodiscard]] HttpResponse answer_with_job(Api& api, const HttpRequest& request,
                                           const Cancellation& cancellation, JobSubject subject,
                                           JobWork work);

/// Applies edits under If-Match; `pointer_of` maps a pointer of core's (`/edits/2/...`) to the request's
/// shape.
[[nodiscard]] std::variant<scene::UpdateResult, proto::Problem> update_scene(
    Api& api, NamedScene& named, const HttpRequest& request, const SharedEdits& edits,
    const Cancellation& cancellation, const std::function<std::string(const std::string&)>& pointer_of);
[[nodiscard]] inline std::variant<scene::UpdateResult, proto::Problem> update_scene(
    Api& api, NamedScene& named, const HttpRequest& request, std::vector<scene::SceneEdit> edits,
    const Cancellation& cancellation, const std::function<std::string(const std::string&)>& pointer_of) {
  return update_scene(api, named, request,
                      std::make_shared<const std::vector<scene::SceneEdit>>(std::move(edits)), cancellation,
                      pointer_of);
}

/// An initializer list would copy what an edit holds.
[[nodiscard]] inline std::vector<scene::SceneEdit> one_edit(scene::SceneEdit edit) {
  std::vector<scene::SceneEdit> edits;
  edits.push_back(std::move(edit));
  return edits;
}

/// The handler of a request that changes something: with an Idempotency-Key it does its work once, and who
/// sends the same again gets the same answer.
[[nodiscard]] Handler once_per_key(Api& api, Handler handler);

/// A pointer of core into the one edit of a request, as a pointer into the request: "/edits/0/rest" ->
/// "/rest". Core's world_from_object is the wire's transform.
[[nodiscard]] std::string pointer_of_one(const std::string& pointer);

/// Of edits in a body: the scene is there, and what an edit names inside of it and is not there makes the
/// body invalid.
[[nodiscard]] proto::Problem in_body(proto::Problem problem);

/// The mesh of the path's {m}.
[[nodiscard]] std::variant<std::uint32_t, proto::Problem> open_mesh(const scene::Scene& scene,
                                                                    const HttpRequest& request);

}  // namespace gridcast::server
