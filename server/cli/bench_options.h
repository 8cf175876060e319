#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/measure/bench.h"
#include "server/cli/progress_bar.h"

namespace gridcast::server {

/// What `gridcast bench` was asked for.
struct BenchRequest {
  std::vector<std::string> scenes;  ///< empty: S and I, of which `deform` takes S1 and S2
  std::vector<std::string> sets;
  std::vector<std::string> structures;
  std::vector<std::string> precisions;
  std::vector<std::string> sections;
  std::vector<std::size_t> threads{1};
  std::vector<std::string> clients{"shared"};
  std::string file, json_path;
  std::size_t rays = 0, repeat = 0, frames = 0;  ///< 0: the default, or that of --quick
  double phase_s = 0.0;                          ///< likewise
  double size = 0.0;
  std::uint64_t seed = 1;
  bool quick = false, quiet = false;

  [[nodiscard]] Verbosity verbosity() const { return quiet ? Verbosity::kQuiet : Verbosity::kNormal; }
  /// The scenes' own names, in the order of the catalogue; the groups S, I, W and `all` spelled out.
  [[nodiscard]] std::vector<std::string> scene_names() const;
  [[nodiscard]] bool names(const std::string& section) const;
  /// Whether it is named, or none is.
  [[nodiscard]] bool wants(const std::string& section) const;
  /// Whether `deform` takes this scene: any that was asked for, else those it takes by itself.
  [[nodiscard]] bool deforms(const std::string& scene) const;
  /// Whether `load` takes this scene: any that was asked for, else S1.
  [[nodiscard]] bool loads(const std::string& scene) const;
  /// Whether any other section is wanted.
  [[nodiscard]] bool wants_more_than(const std::vector<std::string>& known) const;
  [[nodiscard]] measure::BenchOptions options(std::stop_token stop) const;
  [[nodiscard]] double scene_size() const;
};
void add_bench_options(CLI::App& app, BenchRequest& request);

}  // namespace gridcast::server
