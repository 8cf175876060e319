#pragma once
// The parts of the section `load`, each for one number of threads.

#include <algorithm>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/measure/bench.h"
#include "server/bench/cores_apart.h"

namespace gridcast::server {

/// What all parts share.
struct LoadBench {
  const std::string& scene_name;
  std::shared_ptr<const scene::Scene> scene;
  const measure::View& view;
  const measure::RaySet& rays;  ///< as many as options.rays
  std::size_t threads = 1;
  const measure::BenchOptions& options;
  measure::Report& report;
  const CoresApart* apart = nullptr;  ///< null: clients share the server's cores

  [[nodiscard]] bool stopped() const { return options.stop.stop_requested(); }
  /// The first `count` rays as float32 rows.
  [[nodiscard]] std::span<const std::byte> first_rays(std::size_t count) const {
    return rays.batch().bytes.first(std::min(count, rays.size()) * rays.batch().row_bytes());
  }
  /// `count` of them, the set again and again.
  [[nodiscard]] std::vector<std::byte> repeated_rays(std::size_t count) const;
};

/// The head of a POST to rays/closest without its last lines.
[[nodiscard]] std::string binary_head(std::string_view query);
[[nodiscard]] std::string json_head();

/// JSON batches of as many rays as the server takes.
[[nodiscard]] Status bench_json_batches(const LoadBench& bench);
/// One ray after the other, beside a handler that does nothing, batches, and clients that drip.
[[nodiscard]] Status bench_latency(const LoadBench& bench);
/// The peak, and what becomes of it when more is asked for.
[[nodiscard]] Status bench_saturation(const LoadBench& bench);
/// Clients that go.
[[nodiscard]] Status bench_gone(const LoadBench& bench);

}  // namespace gridcast::server
