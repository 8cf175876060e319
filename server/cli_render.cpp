#include <charconv>
#include <cstdio>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "core/io/image.h"
#include "proto/vocabulary.h"
#include "server/cli_common.h"
#include "server/http_types.h"
#include "server/picture.h"
#include "server/signals.h"
#include "server/thread_limit.h"
#include "server/vector_option.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
The picture is a PNG or an EXR by the name's ending. Without --camera or --eye the file's first usable camera is
taken, or one that frames the scene. --layers adds depth, normal, instance_id, mesh_id or primitive_id to an EXR.

Examples:
  gridcast render engine.glb -o engine.png --width 800 --height 600 --samples 4
  gridcast render engine.glb -o engine.exr --layers depth,normal,instance_id
  gridcast render engine.glb -o top.png --eye 0,500,1 --target 0,0,0 --yfov-deg 40)";

std::vector<std::string> words(auto const& names) {
  return {names.begin(), names.end()};
}

class RenderCommand final : public Command {
 public:
  explicit RenderCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    add_file_options(app, file_);
    app.add_option("-o,--output", output_, "The picture: NAME.png or NAME.exr")->required();
    app.add_option("--width", request_.width_px, "Pixels")
        ->capture_default_str()
        ->check(CLI::Range(1, 16384));
    app.add_option("--height", request_.height_px, "Pixels")
        ->capture_default_str()
        ->check(CLI::Range(1, 16384));
    app.add_option("--camera", camera_, "auto, or the index of a camera in the file")->capture_default_str();
    CLI::Option* eye = app.add_option("--eye", eye_, "Where the camera is: x,y,z in metres");
    app.add_option("--target", target_, "What it looks at: x,y,z")->needs(eye)->capture_default_str();
    app.add_option("--up", up_, "Which way is up: x,y,z")->needs(eye)->capture_default_str();
    app.add_option("--yfov-deg", yfov_deg_, "Full vertical angle of view")->needs(eye)->capture_default_str();
    app.add_option("--integrator", request_.integrator, "whitted, depth, normal or id")
        ->capture_default_str()
        ->check(CLI::IsMember(words(proto::kIntegratorNames)));
    app.add_option("--layers", request_.layers, "Layers beside the integrator's own, with commas; EXR only")
        ->delimiter(',')
        ->check(CLI::IsMember(words(proto::kLayerNames)));
    app.add_option("--samples", request_.samples, "Per pixel")
        ->capture_default_str()
        ->check(CLI::Range(1, 4096));
    app.add_option("--max-depth", request_.max_depth, "Reflections and refractions after the primary ray")
        ->capture_default_str()
        ->check(CLI::Range(0, 64));
    app.add_option("--precision", precision_, "fast, robust or exact")
        ->capture_default_str()
        ->check(CLI::IsMember(words(kPrecisionNames)));
  }

  int run(const std::stop_token& stop) override {
    if (const auto wrong = read_options()) {
      std::fprintf(stderr, "gridcast: %s (see gridcast render --help)\n", wrong->c_str());
      return kExitUsage;
    }
    const ThreadLimit limit(file_.threads);
    const auto loaded = load_for_command(file_, stop);
    if (!loaded) return stop.stop_requested() ? kExitInterrupted : kExitFailed;
    auto settings = render_settings(*loaded->scene, request_);
    if (!settings) return report(file_.path, settings.error());
    const Clock::time_point started = Clock::now();
    ProgressBar bar("rendering", file_.verbosity());
    const auto film = render::render(*loaded->scene, *settings, stop, bar.callback());
    if (!film) return report(file_.path, film.error());
    const double render_ms = ms_between(started, Clock::now());
    const auto bytes = encode_picture(*film, request_.format);
    if (!bytes) return report(output_, bytes.error());
    if (const Status written = io::write_file(output_, *bytes); !written)
      return report(output_, written.error());
    summarise(render_ms, bytes->size());
    return kExitDone;
  }

 private:
  /// What CLI11 cannot check: a sentence when something is wrong.
  std::optional<std::string> read_options() {
    const std::string ending = std::filesystem::path(output_).extension().string();
    if (ending != ".png" && ending != ".exr") return "the output's name must end in .png or .exr";
    request_.format = ending == ".exr" ? proto::ImageFormat::kExr : proto::ImageFormat::kPng;
    if (!request_.layers.empty() && ending == ".png") return "--layers needs an .exr";
    request_.precision = parse_precision(precision_).value();
    if (camera_ != "auto" && !eye_.empty()) return "--camera and --eye exclude each other";
    if (!eye_.empty()) return read_view();
    if (camera_ == "auto") return std::nullopt;
    proto::FileCamera camera;
    const char* end = camera_.data() + camera_.size();
    if (std::from_chars(camera_.data(), end, camera.index).ptr != end || camera_.empty())
      return "--camera is auto or an index";
    request_.camera = camera;
    return std::nullopt;
  }

  std::optional<std::string> read_view() {
    const auto eye = parse_vector(eye_);
    const auto target = parse_vector(target_);
    const auto up = parse_vector(up_);
    if (!eye || !target || !up) return "--eye, --target and --up are three finite numbers with commas: x,y,z";
    request_.camera = proto::LookAtCamera{*eye, *target, *up, yfov_deg_};
    return std::nullopt;
  }

  void summarise(double render_ms, std::size_t bytes) const {
    const double pixels = double(request_.width_px) * double(request_.height_px);
    if (file_.style() == OutputStyle::kJson) {
      const nlohmann::ordered_json json{
          {"output", output_},           {"width_px", request_.width_px}, {"height_px", request_.height_px},
          {"samples", request_.samples}, {"render_ms", render_ms},        {"bytes", bytes}};
      std::printf("%s\n",
                  json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
    } else if (file_.verbosity() != Verbosity::kQuiet) {
      std::printf("%s: %d x %d pixels, %d samples, %.1f ms, %.2f Mpixel/s\n", output_.c_str(),
                  request_.width_px, request_.height_px, request_.samples, render_ms,
                  pixels / render_ms / 1000.0);
    }
  }

  FileOptions file_;
  proto::RenderRequest request_;
  std::string output_;
  std::string camera_ = "auto";
  std::string eye_;
  std::string target_ = "0,0,0";
  std::string up_ = "0,1,0";
  double yfov_deg_ = 45.0;
  std::string precision_ = "robust";
};

}  // namespace

std::unique_ptr<Command> make_render_command(CLI::App& program) {
  return std::make_unique<RenderCommand>(*program.add_subcommand("render", "Render a picture of a scene"));
}

}  // namespace gridcast::server
