#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "core/io/image.h"
#include "core/math/precision_names.h"
#include "core/measure/tradeoff.h"
#include "core/scene/flatten.h"
#include "server/chart/chart_gnuplot.h"
#include "server/chart/chart_vega.h"
#include "server/chart/gnuplot.h"
#include "server/chart/tradeoff_json.h"
#include "server/cli/common.h"
#include "server/number_text.h"
#include "server/signals.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
Every structure in every precision, and Embree as a program uses it itself (default and ROBUST), is timed side by
side and compared with exact answers, on eight classes of rays. The chart has a panel for each class: speed goes to
the right, errors (missed, false and wrong hits per million rays) go down, so the best is at the upper right. No error
among N rays means no more than a rate below 3/N: such points lie in a band above that line. Rings mark the Pareto
front. SVG and PNG are drawn by gnuplot (Debian: gnuplot-nox); .json and .csv hold every figure, .vl.json is a Vega-Lite
specification for a page.

SCENE is a .glb or .gltf file, or a scene of the benchmark by name (S1 to S6, I1 to I3, W1 to W5, H1).

Examples:
  gridcast chart engine.glb -o chart.svg -o chart.json
  gridcast chart engine.glb -o chart.png --set edge,vertex --structure wide_bvh,kd_tree --rays 100000
  gridcast chart H1 -o hostile.svg --quick)";

constexpr std::size_t kQuickAccuracyRays = 2000, kQuickSpeedRays = 10'000, kQuickRepeat = 3;

bool ends_with(const std::string& text, std::string_view end) {
  return std::string_view(text).ends_with(end);
}

bool needs_gnuplot(const std::string& path) {
  return ends_with(path, ".svg") || ends_with(path, ".png");
}

std::vector<std::string> class_names() {
  std::vector<std::string> names;
  names.reserve(measure::kAllRayClasses.size());
  for (const measure::RayClass ray_class : measure::kAllRayClasses)
    names.emplace_back(measure::to_string(ray_class));
  return names;
}

class ChartCommand final : public Command {
 public:
  explicit ChartCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    app.add_option("SCENE", scene_, "A .glb or .gltf file, or the name of a generated scene")->required();
    app.add_option("-o,--output", outputs_,
                   "NAME.svg, .png, .json, .csv or .vl.json; may be given several times")
        ->required()
        ->allow_extra_args(false);
    app.add_option("--set", classes_, "Ray classes, with commas; without it all")
        ->delimiter(',')
        ->check(CLI::IsMember(class_names()));
    app.add_option("--structure", structures_,
                   "Trees of ours, with commas; without it wide_bvh, compact_bvh, bvh, kd_tree, embree, and "
                   "brute_force on scenes of up to 2,000 triangles")
        ->delimiter(',')
        ->check(CLI::IsMember({"brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"}));
    app.add_option("--precision", precisions_, "fast, robust, exact, with commas; without it all")
        ->delimiter(',')
        ->check(CLI::IsMember({"fast", "robust", "exact"}));
    app.add_option("--rays", rays_, "Rays a class compared with exact answers; without it 20,000")
        ->check(CLI::Range(1, 100'000'000));
    app.add_option("--speed-rays", speed_rays_, "Rays a class that are timed; without it 100,000")
        ->check(CLI::Range(1, 100'000'000));
    app.add_option("--repeat", repeat_, "Timings that the median is taken of; without it 5")
        ->check(CLI::Range(1, 1000));
    app.add_option("--threads", options_.threads, "Threads that are timed")
        ->capture_default_str()
        ->check(CLI::Range(1, 256));
    app.add_option("--seed", options_.seed, "Of rays and generated scenes")->capture_default_str();
    app.add_option("--size", size_, "Share of a generated scene's triangles or instances")
        ->capture_default_str()
        ->check(CLI::Range(1e-6, 1.0));
    app.add_flag("--quick", quick_, "2,000 rays a class, 10,000 timed three times");
    app.add_flag("-q,--quiet", quiet_, "No progress bar, no remarks");
  }

  int run(const std::stop_token& stop) override {
    options_.stop = stop;
    if (const int code = check_outputs(); code != kExitDone) return code;
    read_options();
    auto scene = load();
    if (!scene) return report(scene_, scene.error());
    options_.view = scene->view;
    ProgressBar bar("measuring " + scene->name, verbosity());
    const auto found = measure::measure_tradeoffs(scene->data, options_, bar.callback());
    if (!found) return report(scene_, found.error());
    if (!quiet_)
      for (const std::string& note : found->notes) std::fprintf(stderr, "gridcast: %s\n", note.c_str());
    if (found->rows.empty())
      return report(scene_, {ErrorCode::kInvalidArgument, "no class of rays is left", ""});
    for (const std::string& path : outputs_)
      if (const int code = write(path, *found, scene->name); code != kExitDone) return code;
    return kExitDone;
  }

 private:
  [[nodiscard]] Verbosity verbosity() const { return quiet_ ? Verbosity::kQuiet : Verbosity::kNormal; }

  /// What would be a pity to find out after minutes of measuring.
  [[nodiscard]] int check_outputs() const {
    for (const std::string& path : outputs_) {
      if (!needs_gnuplot(path) && !ends_with(path, ".json") && !ends_with(path, ".csv")) {
        std::fprintf(
            stderr,
            "gridcast: the output's name must end in .svg, .png, .json, .csv or .vl.json (see gridcast "
            "chart --help)\n");
        return kExitUsage;
      }
      const std::filesystem::path folder = std::filesystem::path(path).parent_path();
      std::error_code ignored;
      if (!folder.empty() && !std::filesystem::is_directory(folder, ignored))
        return report(path, {ErrorCode::kNotFound, "the folder does not exist", ""});
    }
    const auto drawn = std::ranges::find_if(outputs_, needs_gnuplot);
    if (drawn == outputs_.end()) return kExitDone;
    const Status found = find_gnuplot();
    return found ? kExitDone : report(*drawn, found.error());
  }

  void read_options() {
    if (quick_) {
      options_.accuracy_rays = kQuickAccuracyRays;
      options_.speed_rays = kQuickSpeedRays;
      options_.repeat = kQuickRepeat;
    }
    if (rays_ > 0) options_.accuracy_rays = rays_;
    if (speed_rays_ > 0) options_.speed_rays = speed_rays_;
    if (repeat_ > 0) options_.repeat = repeat_;
    if (!classes_.empty()) options_.classes.clear();
    for (const measure::RayClass ray_class : measure::kAllRayClasses)
      if (std::ranges::count(classes_, std::string(measure::to_string(ray_class))) > 0)
        options_.classes.push_back(ray_class);
    for (const std::string& name : structures_)
      options_.structures.push_back(blas::parse_structure_kind(name).value());
    if (!precisions_.empty()) options_.precisions.clear();
    for (const std::string& name : precisions_) options_.precisions.push_back(to_precision(name));
  }

  [[nodiscard]] Result<measure::BenchScene> load() const {
    const auto known = measure::scene_catalogue();
    if (std::ranges::any_of(known, [&](const auto& entry) { return entry.name == scene_; }))
      return measure::make_scene(scene_, options_.seed, size_);
    ProgressBar bar("building", verbosity());
    LoadOptions load;
    load.stop = options_.stop;
    load.progress = bar.callback();
    const auto loaded = load_scene_file(scene_, load);
    if (!loaded) return loaded.error();
    return measure::framed_scene(std::filesystem::path(scene_).stem().string(),
                                 scene::flattened(*loaded->scene), loaded->scene->bounds());
  }

  [[nodiscard]] Result<std::vector<std::byte>> encode(const std::string& path,
                                                      const measure::TradeoffReport& found,
                                                      const std::string& name) const {
    using Json = nlohmann::ordered_json;
    if (needs_gnuplot(path)) {
      const PlotFormat format = ends_with(path, ".svg") ? PlotFormat::kSvg : PlotFormat::kPng;
      return run_gnuplot(gnuplot_script(make_chart(found, name), format), options_.stop);
    }
    std::string text;
    if (ends_with(path, ".csv"))
      text = tradeoff_csv(found);
    else if (ends_with(path, ".vl.json"))
      text = vega_chart(make_chart(found, name), found).dump(1, ' ', false, Json::error_handler_t::replace) +
             "\n";
    else
      text = tradeoff_json(found, name).dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
    const auto bytes = std::as_bytes(std::span(text));
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  }

  int write(const std::string& path, const measure::TradeoffReport& found, const std::string& name) const {
    const auto bytes = encode(path, found, name);
    if (!bytes) return report(path, bytes.error());
    if (const Status written = io::write_file(path, *bytes); !written) return report(path, written.error());
    if (!quiet_)
      std::printf("%s: %zu points, %s\n", path.c_str(), found.rows.size(), bytes_text(bytes->size()).c_str());
    return kExitDone;
  }

  std::string scene_;
  std::vector<std::string> outputs_, classes_, structures_, precisions_;
  std::size_t rays_ = 0, speed_rays_ = 0, repeat_ = 0;
  double size_ = 1.0;
  bool quick_ = false, quiet_ = false;
  measure::TradeoffOptions options_;
};

}  // namespace

std::unique_ptr<Command> make_chart_command(CLI::App& program) {
  return std::make_unique<ChartCommand>(*program.add_subcommand(
      "chart", "Chart speed against accuracy beside Embree, on a file or a generated scene"));
}

}  // namespace gridcast::server
