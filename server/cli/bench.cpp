#include "core/measure/bench.h"

#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>

#include "core/io/image.h"
#include "core/measure/crowd.h"
#include "core/measure/embree_yardstick.h"
#include "core/scene/flatten.h"
#include "server/bench/crowd.h"
#include "server/bench/load.h"
#include "server/bench/serve.h"
#include "server/cli/bench_json.h"
#include "server/cli/bench_options.h"
#include "server/cli/bench_report.h"
#include "server/cli/common.h"
#include "server/number_text.h"
#include "server/signals.h"

namespace gridcast::server {
namespace {

class BenchCommand final : public Command {
 public:
  explicit BenchCommand(CLI::App& app) : Command(app) { add_bench_options(app, request_); }

  int run(const std::stop_token& stop) override {
    stop_ = stop;
    options_ = request_.options(stop);
    if (!request_.quiet) print_head();
    int code = kExitDone;
    if (request_.wants_more_than({"crowd"}))
      code = request_.file.empty() ? measure_generated() : measure_file();
    if (code == kExitDone && (request_.file.empty() ? request_.wants("crowd") : request_.names("crowd")))
      code = measure_crowd();
    if (code != kExitDone) return code;
    if (!request_.json_path.empty()) {
      const std::string text = bench_json(report_, options_, request_.scene_size());
      const Status written = io::write_file(request_.json_path, std::as_bytes(std::span(text)));
      if (!written) return report(request_.json_path, written.error());
    }
    const std::uint64_t wrong = wrong_answers(report_);
    if (wrong == 0) return kExitDone;
    std::fprintf(stderr, "gridcast: %llu answers differ that must not\n",
                 static_cast<unsigned long long>(wrong));
    return kExitFailed;
  }

 private:
  void print_head() const {
    const measure::EmbreeInfo embree = measure::embree_info();
    std::printf("Embree %s (assertions compiled in: %s), %s rays a set, %zu repetitions, seed %llu\n",
                embree.version.c_str(), embree.assertions.c_str(), grouped(options_.rays).c_str(),
                options_.repeat, static_cast<unsigned long long>(request_.seed));
  }

  int measure_generated() {
    for (const std::string& name : request_.scene_names()) {
      auto scene = measure::make_scene(name, request_.seed, request_.scene_size());
      if (!scene) return report("bench", scene.error());
      if (const int code = measure_scene(*scene); code != kExitDone) return code;
    }
    return kExitDone;
  }

  int measure_file() {
    FileOptions file;
    file.path = request_.file;
    file.quiet = request_.quiet;
    const auto loaded = load_for_command(file, stop_);
    if (!loaded) return stop_.stop_requested() ? kExitInterrupted : kExitFailed;
    const std::string name = std::filesystem::path(request_.file).stem().string();
    return measure_scene(
        measure::framed_scene(name, scene::flattened(*loaded->scene), loaded->scene->bounds()));
  }

  using Section = Status (*)(const measure::BenchScene&, const measure::BenchOptions&, measure::Report&,
                             const scene::ProgressCallback&);

  int measure_scene(const measure::BenchScene& scene) {
    // Instances of one generated mesh: its tree has been measured as a scene of its own.
    const bool has_own_mesh = measure::is_single_mesh(scene.data) || !request_.file.empty();
    const std::pair<const char*, Section> sections[] = {
        {"rays", measure::bench_rays},
        {"build", has_own_mesh ? measure::bench_builds : nullptr},
        {"refit", has_own_mesh ? measure::bench_refits : nullptr},
        {"instances", measure::bench_instances},
        {"deform", has_own_mesh && request_.deforms(scene.name) ? measure::bench_deformations : nullptr},
        {"serve", bench_serve},
        {"load", request_.loads(scene.name) ? bench_load : nullptr}};
    for (const auto& [name, section] : sections) {
      if (section == nullptr || !request_.wants(name)) continue;
      if (const int code = run_section(name, section, scene); code != kExitDone) return code;
    }
    return kExitDone;
  }

  int measure_crowd() {
    const measure::CrowdSize size = measure::crowd_size(request_.scene_size());
    return run_section("crowd", bench_crowd, measure::crowd_scene(size, request_.seed));
  }

  int run_section(const std::string& name, Section section, const measure::BenchScene& scene) {
    measure::BenchOptions options = options_;
    // One coherent and one incoherent set say what HTTP costs.
    if (name == "serve" && request_.sets.empty())
      options.sets = {measure::RaySetKind::kPrimary, measure::RaySetKind::kDiffuseShuffled};
    const auto measured = [&] {
      ProgressBar bar("measuring " + scene.name + ", " + name, request_.verbosity());
      return section(scene, options, report_, bar.callback());
    };
    const Status status = measured();
    if (!request_.quiet) print_new_rows(report_, printed_);
    return status ? kExitDone : report(scene.name, status.error());
  }

  static int report(const std::string& what, const Error& error) { return server::report(what, error); }

  BenchRequest request_;
  measure::BenchOptions options_;
  measure::Report report_, printed_;
  std::stop_token stop_;
};

}  // namespace

std::unique_ptr<Command> make_bench_command(CLI::App& program) {
  return std::make_unique<BenchCommand>(
      *program.add_subcommand("bench", "Measure speed beside Embree, on generated scenes or a file"));
}

}  // namespace gridcast::server
