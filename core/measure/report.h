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

struct Report {
  std::vector<RayRow> rays;
  std::vector<CheckRow> checks;
};

/// Answers that should have been equal bit for bit and were not.
[[nodiscard]] std::uint64_t wrong_answers(const Report& report);

}  // namespace gridcast::measure
