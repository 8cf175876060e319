#include <cstdio>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "core/io/image.h"
#include "core/math/precision_names.h"
#include "core/scene/trace.h"
#include "proto/hit_reply.h"
#include "proto/vocabulary.h"
#include "server/cli/cast_rays.h"
#include "server/cli/common.h"
#include "server/cli/masks.h"
#include "server/cli/vector_option.h"
#include "server/http/http_types.h"
#include "server/number_text.h"
#include "server/signals.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
Rays come from one of
  --camera-grid WxH   one through each pixel's centre of a camera that sees the scene
  --rays FILE         little-endian rows of 6 (ox oy oz dx dy dz) or 8 (ox oy oz tnear dx dy dz tfar) numbers
  --json-rays FILE    {"origins": [[x,y,z],...], "directions": [[x,y,z],...], "tnear": [...], "tfar": [...]}
where FILE may be - for standard input. Answers go to -o NAME.json or NAME.bin (columns behind a JSON head, as the
server sends them).

Examples:
  gridcast cast engine.glb --camera-grid 1024x1024
  gridcast cast engine.glb --rays rays.f32 -o hits.bin
  gridcast cast engine.glb --rays rays.f32 --fields t_error,instance_id -o hits.json
  gridcast cast engine.glb --rays rays.f32 --instance-mask 3=0,4=2 --mask 1
  echo '{"origins": [[0,0,900]], "directions": [[0,0,-1]]}' | gridcast cast engine.glb --json-rays - -o hits.json)";

class CastCommand final : public Command {
 public:
  explicit CastCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    add_file_options(app, file_);
    CLI::Option* grid =
        app.add_option("--camera-grid", source_.camera_grid, "Rays of a camera: WIDTHxHEIGHT");
    CLI::Option* rays =
        app.add_option("--rays", source_.binary_path, "Binary rays; - = stdin")->excludes(grid);
    app.add_option("--json-rays", source_.json_path, "JSON rays; - = stdin")->excludes(grid)->excludes(rays);
    app.add_option("--dtype", source_.scalar, "Numbers of --rays: float32 or float64")
        ->capture_default_str()
        ->check(CLI::IsMember({"float32", "float64"}));
    app.add_option("--columns", source_.columns, "Numbers a ray of --rays: 6 or 8")
        ->capture_default_str()
        ->check(CLI::IsMember({6, 8}));
    app.add_option("-o,--output", output_, "Answers: NAME.json or NAME.bin");
    app.add_option("--fields", fields_, "Columns of the answers; all but t_error when absent")
        ->delimiter(',')
        ->check(CLI::IsMember(
            std::vector<std::string>(proto::kHitFieldNames.begin(), proto::kHitFieldNames.end())));
    masks_.add_to(app);
    app.add_flag("--any", any_, "Only whether anything is hit, not what is hit first");
    app.add_option("--precision", precision_, "fast, robust or exact")
        ->capture_default_str()
        ->check(CLI::IsMember(std::vector<std::string>(kPrecisionNames.begin(), kPrecisionNames.end())));
  }

  int run(const std::stop_token& stop) override {
    const std::string ending = std::filesystem::path(output_).extension().string();
    if (source_.camera_grid.empty() && source_.binary_path.empty() && source_.json_path.empty())
      return usage("rays are needed: --camera-grid, --rays or --json-rays");
    if (!source_.camera_grid.empty() && !parse_size(source_.camera_grid))
      return usage("--camera-grid is WIDTHxHEIGHT, each from 1 to 65536");
    if (!output_.empty() && ending != ".json" && ending != ".bin")
      return usage("the output's name must end in .json or .bin");
    if (const auto wrong = masks_.read()) return usage(wrong->c_str());
    const ThreadLimit limit(file_.threads);
    const auto loaded = load_for_command(file_, stop);
    if (!loaded) return stop.stop_requested() ? kExitInterrupted : kExitFailed;
    const auto scene = masks_.masked(loaded->scene);
    if (!scene) return report(file_.path, scene.error());
    const auto rays = read_rays(source_, **scene, stop);
    if (!rays) return report(rays_name(), rays.error());
    return any_ ? cast_any(**scene, **rays, stop) : cast_closest(**scene, **rays, stop);
  }

 private:
  static int usage(const char* text) {
    std::fprintf(stderr, "gridcast: %s (see gridcast cast --help)\n", text);
    return kExitUsage;
  }
  [[nodiscard]] std::string rays_name() const {
    if (!source_.camera_grid.empty()) return "--camera-grid";
    return source_.json_path.empty() ? source_.binary_path : source_.json_path;
  }
  [[nodiscard]] bool to_json_file() const { return output_.ends_with(".json"); }

  [[nodiscard]] HitField fields() const {
    if (fields_.empty()) return HitField::kAll;
    HitField fields{};
    for (const std::string& name : fields_)
      fields = fields | proto::parse_hit_field(name).value_or(HitField{});
    return fields;
  }

  int cast_closest(const scene::Scene& scene, const RaySet& rays, const std::stop_token& stop) {
    const Clock::time_point started = Clock::now();
    ProgressBar bar("tracing", file_.verbosity());
    const auto hits = intersect(scene, rays.batch(), trace_options(fields(), stop, bar));
    if (!hits) return report(file_.path, hits.error());
    const double ms = ms_between(started, Clock::now());
    const proto::ReplyHead head{scene.version(), fields(), std::nullopt};
    if (!output_.empty()) {
      const int code =
          save(to_json_file() ? write_hits_json(*hits, head) : write_hits_binary(*hits, head).to_string());
      if (code != kExitDone) return code;
    }
    summarise(proto::count_statuses(hits->status, ms));
    return kExitDone;
  }

  int cast_any(const scene::Scene& scene, const RaySet& rays, const std::stop_token& stop) {
    const Clock::time_point started = Clock::now();
    ProgressBar bar("tracing", file_.verbosity());
    const auto status = occluded(scene, rays.batch(), trace_options(HitField::kAll, stop, bar));
    if (!status) return report(file_.path, status.error());
    const double ms = ms_between(started, Clock::now());
    const proto::ReplyHead head{scene.version(), fields(), std::nullopt};
    if (!output_.empty()) {
      const int code = save(to_json_file() ? write_occlusion_json(*status, head)
                                           : write_occlusion_binary(*status, head).to_string());
      if (code != kExitDone) return code;
    }
    summarise(proto::count_statuses(*status, ms));
    return kExitDone;
  }

  [[nodiscard]] scene::TraceOptions trace_options(HitField fields, const std::stop_token& stop,
                                                  ProgressBar& bar) const {
    return {parse_precision(precision_).value(), fields, stop, bar.callback(), nullptr, masks_.mask()};
  }

  [[nodiscard]] int save(const std::string& bytes) const {
    const Status written = io::write_file(output_, std::as_bytes(std::span(bytes)));
    return written ? kExitDone : report(output_, written.error());
  }

  void summarise(const proto::RayStats& stats) const {
    const double per_second = stats.trace_ms > 0.0 ? double(stats.rays) / stats.trace_ms * 1000.0 : 0.0;
    if (file_.style() == OutputStyle::kJson) {
      const nlohmann::ordered_json json{{"rays", stats.rays},         {"hits", stats.hits},
                                        {"misses", stats.misses},     {"invalid", stats.invalid},
                                        {"trace_ms", stats.trace_ms}, {"rays_per_s", per_second}};
      std::printf("%s\n", json.dump().c_str());
    } else if (file_.verbosity() != Verbosity::kQuiet) {
      std::printf("%s rays: %s hits, %s misses, %s invalid; %.1f ms, %.2f Mrays/s\n",
                  grouped(stats.rays).c_str(), grouped(stats.hits).c_str(), grouped(stats.misses).c_str(),
                  grouped(stats.invalid).c_str(), stats.trace_ms, per_second / 1e6);
    }
  }

  FileOptions file_;
  RaySource source_;
  MaskOptions masks_;
  std::string output_;
  std::string precision_ = "robust";
  std::vector<std::string> fields_;
  bool any_ = false;
};

}  // namespace

std::unique_ptr<Command> make_cast_command(CLI::App& program) {
  return std::make_unique<CastCommand>(*program.add_subcommand("cast", "Cast a batch of rays into a scene"));
}

}  // namespace gridcast::server
