#pragma once
// What a benchmark run found, as rows. `vs_...` are ratios of speed: above 1 this row is the faster one; they
// are medians over repetitions that ran beside each other, and 0 where there was nothing to compare with.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/measure/load_report.h"

namespace gridcast::measure {

/// Who is measured: engine "gridcast" or "embree".
struct RayRow {
  std::string scene, set;
  std::string engine, structure, precision, entry;
  std::size_t threads = 1;
  double mrays_per_s = 0.0;
  double spread = 0.0;  ///< see spread()
  double vs_embree_default = 0.0, vs_embree_robust = 0.0;
};

/// How the answers behind a RayRow compare with others'. All but `embree_differs` must be 0.
struct CheckRow {
  std::string scene, set, structure, precision, entry;
  std::size_t threads = 1;
  std::uint64_t rays = 0, hits = 0;
  std::uint64_t differs = 0;  ///< from the single rays of the first structure, bit for bit, all runs
  std::uint64_t brute_force_rays = 0, brute_force_differs = 0;  ///< a sample against every triangle
  std::uint64_t embree_differs = 0;  ///< from Embree ROBUST in hit or miss, or by more than 0.1 % in t
};

/// Building the tree of a scene's first mesh. `structure` is ours, or Embree's quality, with _compact where
/// Embree was asked to save memory.
struct BuildRow {
  std::string scene, engine, structure;
  std::size_t threads = 1;
  std::uint64_t triangles = 0;
  double ms = 0.0, mtriangles_per_s = 0.0;
  double spread = 0.0;
  double bytes_per_triangle = 0.0;       ///< the tree alone
  double mesh_bytes_per_triangle = 0.0;  ///< vertices and indices, which both need beside it
  double vs_embree_medium = 0.0, vs_embree_low = 0.0;
};

/// The same tree over moved vertices.
struct RefitRow {
  std::string scene, engine, structure;
  std::size_t threads = 1;
  std::uint64_t triangles = 0;
  double ms = 0.0, mtriangles_per_s = 0.0;
  double spread = 0.0;
  double vs_embree_refit = 0.0;
};

/// A change of the top level. `structure` is the kind of ours, or the quality that Embree builds its tree of
/// instances with.
struct InstanceRow {
  std::string scene, engine, structure;
  std::string update;  ///< build (all boxes known), all_moved, all_moved_and_looked_at, one_percent_moved
  std::size_t threads = 1;
  std::uint64_t instances = 0, moved = 0;
  double ms = 0.0, ns_per_moved = 0.0;
  double spread = 0.0;
  double bytes_per_instance = 0.0;
  double vs_embree = 0.0;  ///< against the faster of Embree's ways; a build, against moving all
};

/// One frame of a deformation of a scene's first mesh. Query times are of single rays on one thread; their
/// ratios are the other way about than `vs_...` elsewhere: above 1 the tree in question is the slower one.
struct DeformRow {
  std::string scene, deformation;
  std::size_t frame = 0;    ///< from 1
  std::string action;       ///< what the update did: refit, rebuild
  double cost_ratio = 0.0;  ///< surface-area cost of the maintained tree by that of a fresh one
  double update_ms = 0.0;   ///< apply_update, as a whole
  double fresh_ns_per_ray = 0.0;
  double vs_fresh = 0.0;          ///< query time of the maintained tree by that of a fresh one
  double spread = 0.0;            ///< of vs_fresh, repetition by repetition
  double embree_update_ms = 0.0;  ///< its REFIT
  double embree_build_ms = 0.0;   ///< a new tree of quality medium
  double embree_refit_vs_fresh =
      0.0;  ///< query time of its tree that is refitted only by that of the new one
};

/// What became of a deformation; `deformation` is `all` for the worst of all of them.
struct DeformSummaryRow {
  std::string scene, deformation;
  std::uint64_t triangles = 0;
  std::size_t frames = 0, rebuilds = 0;
  double median_update_ms = 0.0, worst_update_ms = 0.0;
  double worst_vs_fresh = 0.0;
  std::size_t worst_frame = 0;   ///< 0 for `all`
  double steady_vs_fresh = 0.0;  ///< median over the last third of the frames
  double embree_worst_vs_fresh = 0.0, embree_steady_vs_fresh = 0.0;
};

/// A batch over HTTP on the loopback address, binary both ways.
struct ServeRow {
  std::string scene, set;
  ClientCores clients = ClientCores::kShared;
  std::size_t threads = 1;
  std::uint64_t rays = 0;
  double mrays_per_s = 0.0;
  double spread = 0.0;
  double vs_in_process = 0.0;
};

/// Clients that cast rays over HTTP at a scene whose figures are posed meanwhile, against the same scene
/// while it stands still. Phases of both kinds take turns.
struct CrowdRow {
  std::string scene;
  std::size_t threads = 1, clients = 0;
  std::uint64_t figures = 0, figure_triangles = 0;  ///< what moves
  std::uint64_t instances = 0;                      ///< of the whole scene
  std::size_t pairs = 0;                            ///< of phases
  double phase_s = 0.0;
  /// What seconds are: those on the wall, or `cpu`, the process's CPU time over its threads. Where other
  /// programs run, only the latter sees the process do as much work between updates as it would alone.
  std::string clock;
  double still_mrays_per_s = 0.0, moving_mrays_per_s = 0.0;
  double vs_still = 0.0;                            ///< median of moving by still, pair by pair
  double spread = 0.0;                              ///< of that
  double updates_per_s = 0.0;                       ///< achieved
  double update_p50_ms = 0.0, update_p99_ms = 0.0;  ///< from the request to the answer
  double update_cpu_ms = 0.0;        ///< CPU time of one update while nobody casts, its client's included
  double rebuilds_per_update = 0.0;  ///< meshes
};

struct Report {
  std::vector<RayRow> rays;
  std::vector<BuildRow> build;
  std::vector<RefitRow> refit;
  std::vector<InstanceRow> instances;
  std::vector<DeformRow> deform;
  std::vector<DeformSummaryRow> deform_summary;
  std::vector<ServeRow> serve;
  std::vector<CrowdRow> crowd;
  std::vector<JsonBatchRow> json_batches;
  std::vector<LatencyRow> latency;
  std::vector<LoadRow> load;
  std::vector<GoneRow> gone;
  std::vector<CheckRow> checks;
};

/// Answers that should have been equal bit for bit and were not.
[[nodiscard]] std::uint64_t wrong_answers(const Report& report);

}  // namespace gridcast::measure
