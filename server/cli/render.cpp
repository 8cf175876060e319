#include <cstdio>
#include <string>

#include <nlohmann/json.hpp>

#include "core/io/image.h"
#include "server/cli/common.h"
#include "server/cli/picture_options.h"
#include "server/http/http_types.h"
#include "server/picture.h"
#include "server/signals.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
The picture is a PNG or an EXR by the name's ending. Without --camera or --eye the file's first usable camera is
taken, or one that frames the scene. --layers adds depth, normal, instance_id, mesh_id or primitive_id to an EXR.

Examples:
  gridcast render engine.glb -o engine.png --width 800 --height 600 --samples 4
  gridcast render engine.glb -o engine.exr --layers depth,normal,instance_id
  gridcast render engine.glb -o open.png --instance-mask 3=0
  gridcast render engine.glb -o top.png --eye 0,500,1 --target 0,0,0 --yfov-deg 40)";

class RenderCommand final : public Command {
 public:
  explicit RenderCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    add_file_options(app, file_);
    app.add_option("-o,--output", output_, "The picture: NAME.png or NAME.exr")->required();
    picture_.add_to(app);
  }

  int run(const std::stop_token& stop) override {
    if (const auto wrong = picture_.read(output_)) {
      std::fprintf(stderr, "gridcast: %s (see gridcast render --help)\n", wrong->c_str());
      return kExitUsage;
    }
    const ThreadLimit limit(file_.threads);
    const auto loaded = load_for_command(file_, stop);
    if (!loaded) return stop.stop_requested() ? kExitInterrupted : kExitFailed;
    const auto scene = picture_.masks().masked(loaded->scene);
    if (!scene) return report(file_.path, scene.error());
    auto settings = render_settings(**scene, picture_.request());
    if (!settings) return report(file_.path, settings.error());
    const Clock::time_point started = Clock::now();
    ProgressBar bar("rendering", file_.verbosity());
    const auto film = render::render(**scene, *settings, stop, bar.callback());
    if (!film) return report(file_.path, film.error());
    const double render_ms = ms_between(started, Clock::now());
    const auto bytes = encode_picture(*film, picture_.request().format, stop);
    if (!bytes) return report(output_, bytes.error());
    if (const Status written = io::write_file(output_, *bytes); !written)
      return report(output_, written.error());
    summarise(render_ms, bytes->size());
    return kExitDone;
  }

 private:
  void summarise(double render_ms, std::size_t bytes) const {
    const proto::RenderRequest& request = picture_.request();
    const double pixels = double(request.width_px) * double(request.height_px);
    if (file_.style() == OutputStyle::kJson) {
      const nlohmann::ordered_json json{
          {"output", output_},          {"width_px", request.width_px}, {"height_px", request.height_px},
          {"samples", request.samples}, {"render_ms", render_ms},       {"bytes", bytes}};
      std::printf("%s\n",
                  json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
    } else if (file_.verbosity() != Verbosity::kQuiet) {
      std::printf("%s: %d x %d pixels, %d samples, %.1f ms, %.2f Mpixel/s\n", output_.c_str(),
                  request.width_px, request.height_px, request.samples, render_ms,
                  pixels / render_ms / 1000.0);
    }
  }

  FileOptions file_;
  PictureOptions picture_;
  std::string output_;
};

}  // namespace

std::unique_ptr<Command> make_render_command(CLI::App& program) {
  return std::make_unique<RenderCommand>(*program.add_subcommand("render", "Render a picture of a scene"));
}

}  // namespace gridcast::server
