#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "core/scene/update.h"
#include "server/http/http_server.h"
#include "server/jobs.h"
#include "server/memory_budget.h"
#include "server/scene_store.h"
#include "server/tree_builder.h"

namespace gridcast::server {

/// What GET /metrics shows, in Prometheus' text format. Labels are route patterns and enumerators, never
/// text of a client's.
class Metrics {
 public:
  Metrics();
  ~Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;

  void count_request(const RequestRecord& record);
  void count_rays(std::size_t rays, double trace_ms);
  void count_pixels(std::size_t pixels);
  void count_update(const scene::UpdateReport& report);

  void set_memory(const MemoryBudget& memory);
  /// Other gauges are read from the store and the jobs now.
  [[nodiscard]] std::string text(const SceneStore& store, const JobCounts& jobs, const TreeBuildCounts& trees,
                                 const store::ArchiveCounts& archive, std::size_t requests_in_flight);

 private:
  void set_jobs(const JobCounts& jobs);
  void set_trees(const TreeBuildCounts& trees);
  void set_archive(const store::ArchiveCounts& counts);

  struct Families;
  std::unique_ptr<Families> families_;
};

}  // namespace gridcast::server
