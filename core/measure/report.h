#pragma once
// What a benchmark run found, as rows. `vs_...` are ratios of speed: above 1 this row is the faster one; they
// are medians over repetitions that ran beside each other, and 0 where there was nothing to compare with.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

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
  std::string update;  ///< build (all boxes known), all_moved, one_percent_moved
  std::size_t threads = 1;
  std::uint64_t instances = 0, moved = 0;
  double ms = 0.0, ns_per_moved = 0.0;
  double spread = 0.0;
  double bytes_per_instance = 0.0;
  double vs_embree = 0.0;  ///< against the faster of Embree's ways; a build, against moving all
};

/// A batch over HTTP on the loopback address, binary both ways.
struct ServeRow {
  std::string scene, set;
  std::size_t threads = 1;
  std::uint64_t rays = 0;
  double mrays_per_s = 0.0;
  double spread = 0.0;
  double vs_in_process = 0.0;
};

struct Report {
  std::vector<RayRow> rays;
  std::vector<BuildRow> build;
  std::vector<RefitRow> refit;
  std::vector<InstanceRow> instances;
  std::vector<ServeRow> serve;
  std::vector<CheckRow> checks;
};

/// Answers that should have been equal bit for bit and were not.
[[nodiscard]] std::uint64_t wrong_answers(const Report& report);

}  // namespace gridcast::measure
