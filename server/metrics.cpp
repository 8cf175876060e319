#include "server/metrics.h"

#include <sstream>

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

namespace gridcast::server {
namespace {

// From a health probe to the default deadline of 30 s, about three steps a decade.
const prometheus::Histogram::BucketBoundaries kSeconds{0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1,
                                                       0.2,    0.5,   1.0,   2.0,   5.0,  10.0, 30.0};

prometheus::Family<prometheus::Gauge>& gauge(prometheus::Registry& registry, const char* name,
                                             const char* help) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry);
}
prometheus::Family<prometheus::Counter>& counter(prometheus::Registry& registry, const char* name,
                                                 const char* help) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry);
}

/// Counters that are counted elsewhere: brought up to what they are there.
void bring_up(prometheus::Counter& counter, std::uint64_t total) {
  counter.Increment(double(total) - counter.Value());
}

}  // namespace

struct Metrics::Families {
  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>& requests =
      counter(registry, "gridcast_http_requests_total", "Requests answered, by route and status");
  prometheus::Family<prometheus::Histogram>& seconds =
      prometheus::BuildHistogram()
          .Name("gridcast_http_request_duration_seconds")
          .Help("From a request's first byte to its answer, by route")
          .Register(registry);
  // Looked up once: there may be thousands a second, and what each takes is taken from those who are served.
  prometheus::Counter& refused = requests.Add({{"method", "none"}, {"route", "none"}, {"status", "503"}});
  prometheus::Histogram& refused_seconds = seconds.Add({{"route", "none"}}, kSeconds);
  prometheus::Counter& rays = counter(registry, "gridcast_rays_total", "Rays traced for clients").Add({});
  prometheus::Counter& trace_seconds =
      counter(registry, "gridcast_trace_seconds_total", "Time spent tracing them").Add({});
  prometheus::Counter& pixels = counter(registry, "gridcast_pixels_total", "Pixels rendered").Add({});
  prometheus::Family<prometheus::Counter>& updates =
      counter(registry, "gridcast_mesh_updates_total", "Meshes whose vertices changed, by action");
  prometheus::Counter& refits = updates.Add({{"action", "refit"}});
  prometheus::Counter& rebuilds = updates.Add({{"action", "rebuild"}});
  prometheus::Gauge& trees_waiting = gauge(registry, "gridcast_tree_builds_waiting",
                                           "Trees to be built in the background, the one at work included")
                                         .Add({});
  prometheus::Family<prometheus::Counter>& tree_builds = counter(
      registry, "gridcast_tree_builds_total", "Trees built in the background, by what became of them");
  prometheus::Counter& tree_seconds =
      counter(registry, "gridcast_tree_build_seconds_total", "Time spent building them").Add({});
  prometheus::Gauge& in_flight =
      gauge(registry, "gridcast_requests_in_flight", "Requests being worked on, this one included").Add({});
  prometheus::Gauge& scenes = gauge(registry, "gridcast_scenes", "Scenes held").Add({});
  prometheus::Gauge& versions =
      gauge(registry, "gridcast_scene_versions", "Versions in memory: those kept and those still read")
          .Add({});
  prometheus::Gauge& kept_versions =
      gauge(registry, "gridcast_scene_kept_versions",
            "Versions that can be asked for, the newest of each scene among them")
          .Add({});
  prometheus::Gauge& log_bytes =
      gauge(registry, "gridcast_scene_log_bytes", "Updates in the logs of all scenes, as they are in memory")
          .Add({});
  prometheus::Gauge& instances = gauge(registry, "gridcast_instances", "Live instances, all scenes").Add({});
  prometheus::Gauge& triangles =
      gauge(registry, "gridcast_triangles", "Triangles of the meshes stored, all scenes").Add({});
  prometheus::Gauge& memory =
      gauge(registry, "gridcast_scene_memory_bytes", "Estimate of what the scenes hold").Add({});
  prometheus::Gauge& resident =
      gauge(registry, "gridcast_process_memory_bytes", "Resident memory of the process").Add({});
  prometheus::Gauge& budget =
      gauge(registry, "gridcast_memory_budget_bytes", "What it may hold; 0: as much as there is").Add({});
  prometheus::Family<prometheus::Gauge>& jobs =
      gauge(registry, "gridcast_jobs", "Jobs that have not ended, by state");
  prometheus::Family<prometheus::Counter>& jobs_ended =
      counter(registry, "gridcast_jobs_ended_total", "Jobs that have ended, by state");
  prometheus::Counter& jobs_refused =
      counter(registry, "gridcast_jobs_refused_total", "Jobs refused because the queue was full").Add({});
  prometheus::Gauge& damaged =
      gauge(registry, "gridcast_scenes_damaged", "Stored scenes that cannot be served").Add({});
  prometheus::Counter& store_commits =
      counter(registry, "gridcast_store_commits_total", "Transactions made durable").Add({});
  prometheus::Counter& store_failures =
      counter(registry, "gridcast_store_failures_total", "Changes that could not be stored").Add({});
  prometheus::Counter& store_compactions =
      counter(registry, "gridcast_store_compactions_total", "Logs of updates folded into a snapshot").Add({});
  prometheus::Counter& store_bytes =
      counter(registry, "gridcast_store_written_bytes_total", "Written to the data folder's files").Add({});
  prometheus::Counter& structures_found =
      counter(registry, "gridcast_structures_from_cache_total", "Trees that a restart did not have to build")
          .Add({});
  prometheus::Counter& structures_kept =
      counter(registry, "gridcast_structures_kept_total", "Built trees written to the data folder").Add({});
  prometheus::Counter& structures_rejected =
      counter(registry, "gridcast_structures_rejected_total",
              "Kept trees that were damaged or foreign, removed and built anew")
          .Add({});
  prometheus::Counter& structures_failed =
      counter(registry, "gridcast_structures_not_kept_total", "Built trees that could not be written")
          .Add({});
  prometheus::Gauge& structure_bytes =
      gauge(registry, "gridcast_structure_cache_bytes", "Of the trees kept in the data folder").Add({});
  prometheus::Gauge& job_results =
      gauge(registry, "gridcast_job_result_bytes", "Results of jobs that are kept").Add({});
};

Metrics::Metrics() : families_(std::make_unique<Families>()) {}
Metrics::~Metrics() = default;

void Metrics::count_request(const RequestRecord& record) {
  if (record.is_refusal()) {
    families_->refused.Increment();
    families_->refused_seconds.Observe(record.ms / 1000.0);
    return;
  }
  const std::string route = record.route.empty() ? "none" : record.route;
  families_->requests
      .Add({{"method", record.method.empty() ? "none" : record.method},
            {"route", route},
            {"status", std::to_string(record.status)}})
      .Increment();
  families_->seconds.Add({{"route", route}}, kSeconds).Observe(record.ms / 1000.0);
}

void Metrics::count_rays(std::size_t rays, double trace_ms) {
  families_->rays.Increment(double(rays));
  families_->trace_seconds.Increment(trace_ms / 1000.0);
}

void Metrics::count_pixels(std::size_t pixels) {
  families_->pixels.Increment(double(pixels));
}

void Metrics::count_update(const scene::UpdateReport& report) {
  const auto count = [&](const std::vector<scene::MeshUpdateReport>& meshes) {
    for (const scene::MeshUpdateReport& mesh : meshes)
      (mesh.action == scene::MeshAction::kRefit ? families_->refits : families_->rebuilds).Increment();
  };
  count(report.meshes);
  for (const scene::PoseReport& pose : report.poses) count(pose.meshes);
}

void Metrics::set_jobs(const JobCounts& jobs) {
  families_->jobs.Add({{"state", "queued"}}).Set(double(jobs.queued));
  families_->jobs.Add({{"state", "running"}}).Set(double(jobs.running));
  for (const JobState state : {JobState::kDone, JobState::kFailed, JobState::kCancelled})
    bring_up(families_->jobs_ended.Add({{"state", std::string(to_string(state))}}),
             jobs.ended[std::size_t(state)]);
  bring_up(families_->jobs_refused, jobs.refused);
  families_->job_results.Set(double(jobs.result_bytes));
}

void Metrics::set_trees(const TreeBuildCounts& trees) {
  families_->trees_waiting.Set(double(trees.waiting));
  const auto builds = [this](const char* outcome, std::uint64_t total) {
    bring_up(families_->tree_builds.Add({{"outcome", outcome}}), total);
  };
  builds("replaced", trees.replaced);
  builds("dropped", trees.dropped);
  builds("cancelled", trees.cancelled);
  builds("failed", trees.failed);
  families_->tree_seconds.Increment(trees.ms / 1000.0 - families_->tree_seconds.Value());
}

void Metrics::set_archive(const store::ArchiveCounts& counts) {
  bring_up(families_->store_commits, counts.commits);
  bring_up(families_->store_failures, counts.failures);
  bring_up(families_->store_compactions, counts.compactions);
  bring_up(families_->store_bytes, counts.bytes_written);
  bring_up(families_->structures_found, counts.trees.found);
  bring_up(families_->structures_kept, counts.trees.kept);
  bring_up(families_->structures_rejected, counts.trees.rejected);
  bring_up(families_->structures_failed, counts.trees.failures);
  families_->structure_bytes.Set(double(counts.trees.bytes));
}

void Metrics::set_memory(const MemoryBudget& memory) {
  families_->resident.Set(double(memory.used()));
  families_->budget.Set(double(memory.bytes()));
}

std::string Metrics::text(const SceneStore& store, const JobCounts& jobs, const TreeBuildCounts& trees,
                          const store::ArchiveCounts& archive, std::size_t requests_in_flight) {
  set_jobs(jobs);
  set_trees(trees);
  set_archive(archive);
  families_->damaged.Set(double(store.damaged().size()));
  const auto scenes = store.list();
  double versions = 0;
  double kept_versions = 0;
  double log_bytes = 0;
  double instances = 0;
  double triangles = 0;
  double memory = 0;
  for (const auto& named : scenes) {
    const auto scene = named->snapshot();
    versions += double(named->live_versions());
    const NamedScene::Kept kept = named->kept();
    kept_versions += double(kept.newest - kept.oldest + 1);
    log_bytes += double(kept.log_bytes);
    instances += double(scene->instance_count());
    triangles += double(scene->stored_triangle_count());
    memory += double(scene->memory_bytes());
  }
  families_->scenes.Set(double(scenes.size()));
  families_->versions.Set(versions);
  families_->kept_versions.Set(kept_versions);
  families_->log_bytes.Set(log_bytes);
  families_->instances.Set(instances);
  families_->triangles.Set(triangles);
  families_->memory.Set(memory);
  families_->in_flight.Set(double(requests_in_flight));
  std::ostringstream out;
  prometheus::TextSerializer().Serialize(out, families_->registry.Collect());
  return out.str();
}

}  // namespace gridcast::server
