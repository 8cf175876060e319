#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "core/io/gltf_export.h"
#include "core/io/image.h"
#include "core/scene/update.h"
#include "server/cli/common.h"
#include "server/http/http_types.h"
#include "server/number_text.h"
#include "server/signals.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
The GLB holds the scene as it is cast into and rendered: meshes in their pose, one node for each instance, materials,
cameras and lights; it answers every ray with the same bits. Skins, morph targets and animations are not in it.

Examples:
  gridcast export fox.glb -o fox_running.glb --animation Run --time 0.4
  gridcast export draco_compressed.gltf -o plain.glb)";

class ExportCommand final : public Command {
 public:
  explicit ExportCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    add_file_options(app, file_);
    app.add_option("-o,--output", output_, "The file to write: NAME.glb")->required();
    CLI::Option* animation = app.add_option("--animation", animation_,
                                            "Pose by this animation: its name or its number in the file");
    app.add_option("--time", time_s_, "Time of the animation, in seconds")
        ->needs(animation)
        ->capture_default_str();
  }

  int run(const std::stop_token& stop) override {
    if (const char* wrong = wrong_option()) {
      std::fprintf(stderr, "gridcast: %s (see gridcast export --help)\n", wrong);
      return kExitUsage;
    }
    const ThreadLimit limit(file_.threads);
    const auto loaded = load_for_command(file_, stop);
    if (!loaded) return stop.stop_requested() ? kExitInterrupted : kExitFailed;
    const auto posed = pose(loaded->scene);
    if (!posed) return report(file_.path, posed.error());
    const Clock::time_point started = Clock::now();
    io::ExportOptions options;
    options.stop = stop;
    const auto glb = export_glb(**posed, options);
    if (!glb) return report(file_.path, glb.error());
    if (const Status written = io::write_file(output_, std::as_bytes(std::span(*glb))); !written)
      return report(output_, written.error());
    summarise(**posed, glb->size(), ms_between(started, Clock::now()));
    return kExitDone;
  }

 private:
  [[nodiscard]] const char* wrong_option() const {
    if (!output_.ends_with(".glb")) return "the output's name must end in .glb";
    if (!std::isfinite(time_s_)) return "--time is a finite number";
    return nullptr;
  }

  [[nodiscard]] Result<std::shared_ptr<const scene::Scene>> pose(
      const std::shared_ptr<const scene::Scene>& scene) const {
    if (!animation_) return scene;
    scene::SetPose edit;
    edit.animation = scene::AnimationTime{parse_animation(*scene, *animation_), time_s_};
    auto posed = apply_update(*scene, {std::move(edit)});
    if (!posed) return Error{posed.error().code, posed.error().message, "--animation"};
    return std::move(posed->scene);
  }

  void summarise(const scene::Scene& scene, std::size_t bytes, double ms) const {
    if (file_.style() == OutputStyle::kJson) {
      const nlohmann::ordered_json json{{"output", output_},
                                        {"bytes", bytes},
                                        {"meshes", scene.mesh_count()},
                                        {"instances", scene.instance_count()},
                                        {"ms", ms}};
      std::printf("%s\n",
                  json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
    } else if (file_.verbosity() != Verbosity::kQuiet) {
      std::printf("%s: %s meshes, %s instances, %s, %.1f ms\n", output_.c_str(),
                  grouped(scene.mesh_count()).c_str(), grouped(scene.instance_count()).c_str(),
                  bytes_text(bytes).c_str(), ms);
    }
  }

  FileOptions file_;
  std::string output_;
  std::optional<std::string> animation_;
  double time_s_ = 0.0;
};

}  // namespace

std::unique_ptr<Command> make_export_command(CLI::App& program) {
  return std::make_unique<ExportCommand>(
      *program.add_subcommand("export", "Write a scene in a pose as one plain GLB"));
}

}  // namespace gridcast::server
