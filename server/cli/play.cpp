#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "core/io/image.h"
#include "core/scene/animation.h"
#include "core/scene/pose.h"
#include "core/scene/update.h"
#include "server/cli/common.h"
#include "server/cli/frame_name.h"
#include "server/cli/picture_options.h"
#include "server/http/http_types.h"
#include "server/picture.h"
#include "server/signals.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
The name of the pictures has one place for their number, %d or %04d, and ends in .png or .exr; numbers begin at 0.
Without --frames the animation is played once. Without --camera or --eye the file's first usable camera is taken, or
one that frames all that the animation shows, the same for every picture. Interrupted, it keeps the pictures it has.

Examples:
  gridcast play fox.glb --animation Run --fps 30 -o frame_%04d.png
  gridcast play fox.glb --animation 0 --frames 60 --wrap clamp --width 320 --height 240 -o out/f%d.png

As a film: ffmpeg -framerate 30 -i frame_%04d.png -pix_fmt yuv420p fox.mp4)";

/// Poses looked at to find out what the camera must see.
constexpr std::size_t kFramedPoses = 60;
/// As many as a number of nine digits tells apart; an hour at 60 a second is 216,000.
constexpr std::size_t kMostFrames = 999'999'999;

class PlayCommand final : public Command {
 public:
  explicit PlayCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    add_file_options(app, file_);
    app.add_option("-o,--output", output_, "The pictures: NAME_%04d.png or NAME_%04d.exr")->required();
    app.add_option("--animation", animation_, "Its name or its number in the file")->capture_default_str();
    app.add_option("--fps", fps_, "Pictures per second of the animation")
        ->capture_default_str()
        ->check(CLI::Range(1e-3, 1e6));
    app.add_option("--frames", frames_, "How many pictures; 0 = the animation once")
        ->capture_default_str()
        ->check(CLI::Range(std::size_t(0), kMostFrames));
    app.add_option("--start", start_s_, "Time of the first picture, in seconds")->capture_default_str();
    app.add_option("--wrap", wrap_, "After its end the animation begins again (loop) or holds (clamp)")
        ->capture_default_str()
        ->check(CLI::IsMember({"loop", "clamp"}));
    picture_.add_to(app);
  }

  int run(const std::stop_token& stop) override {
    if (const auto wrong = read_options()) {
      std::fprintf(stderr, "gridcast: %s (see gridcast play --help)\n", wrong->c_str());
      return kExitUsage;
    }
    const ThreadLimit limit(file_.threads);
    auto loaded = load_for_command(file_, stop);
    if (!loaded) return stop.stop_requested() ? kExitInterrupted : kExitFailed;
    auto masked = picture_.masks().masked(std::move(loaded->scene));
    if (!masked) return report(file_.path, masked.error());
    scene_ = *std::move(masked);
    if (const Status found = find_animation(); !found) return report(file_.path, found.error());
    auto settings = make_settings(stop);
    if (!settings) return report(file_.path, settings.error());
    const Clock::time_point started = Clock::now();
    Status status = ok_status();
    {
      ProgressBar bar("playing", file_.verbosity());
      const scene::ProgressCallback progress = bar.callback();
      while (status && written_ < frames_) status = write_frame(*settings, stop, progress);
    }
    if (!status) {
      if (written_ > 0 && file_.verbosity() != Verbosity::kQuiet)
        std::fprintf(stderr, "gridcast: %zu of %zu pictures are written\n", written_, frames_);
      return report(status.error().code == ErrorCode::kIo ? output_ : file_.path, status.error());
    }
    summarise(ms_between(started, Clock::now()));
    return kExitDone;
  }

 private:
  std::optional<std::string> read_options() {
    if (!frame_name(output_, 0)) return "the output's name needs one place for the number: frame_%04d.png";
    if (!std::isfinite(start_s_)) return "--start is a finite number";
    return picture_.read(output_);
  }

  Status find_animation() {
    const auto& animations = scene_->data().animations;
    choice_ = parse_animation(*scene_, animation_);
    // The engine's own answer says which there are; the first pose also says which one was meant.
    const auto posed = pose_at(start_s_);
    if (!posed) return Error{posed.error().code, posed.error().message, "--animation"};
    const scene::Animation& animation = animations[posed->scene->pose().animation->animation_id];
    if (frames_ == 0)
      frames_ = std::clamp<std::size_t>(std::size_t(std::ceil(duration_s(animation) * fps_)), 1, kMostFrames);
    return ok_status();
  }

  [[nodiscard]] Result<scene::UpdateResult> pose_at(double time_s) const {
    scene::SetPose edit;
    edit.animation = scene::AnimationTime{
        choice_, time_s, wrap_ == "loop" ? scene::AnimationWrap::kLoop : scene::AnimationWrap::kClamp};
    return apply_update(*scene_, {std::move(edit)});
  }

  [[nodiscard]] double time_of(std::size_t frame) const { return start_s_ + double(frame) / fps_; }

  Result<render::RenderSettings> make_settings(const std::stop_token& stop) {
    auto settings = render_settings(*scene_, picture_.request());
    if (!settings || !std::holds_alternative<proto::AutoCamera>(picture_.request().camera)) return settings;
    Bounds3d bounds;
    const std::size_t looks = std::min(frames_, kFramedPoses);
    for (std::size_t i = 0; i < looks; ++i) {
      if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "interrupted", ""};
      const auto posed = pose_at(time_of(i * frames_ / looks));
      if (!posed) return posed.error();
      bounds.extend(posed->scene->bounds());
    }
    settings->camera =
        render::default_camera(*scene_, bounds, double(settings->width_px) / double(settings->height_px));
    return settings;
  }

  Status write_frame(const render::RenderSettings& settings, const std::stop_token& stop,
                     const scene::ProgressCallback& progress) {
    auto posed = pose_at(time_of(written_));
    if (!posed) return posed.error();
    // The next pose begins with this one's trees, as in a scene that is served.
    scene_ = std::move(posed->scene);
    scene::ProgressCallback of_frame;
    if (progress) of_frame = [&](double done) { progress((double(written_) + done) / double(frames_)); };
    const auto film = render::render(*scene_, settings, stop, of_frame);
    if (!film) return film.error();
    const auto bytes = encode_picture(*film, picture_.request().format, stop);
    if (!bytes) return bytes.error();
    if (Status status = io::write_file(*frame_name(output_, written_), *bytes); !status)
      return Error{ErrorCode::kIo, status.error().message, status.error().where};
    ++written_;
    return ok_status();
  }

  void summarise(double ms) const {
    const std::string last = *frame_name(output_, written_ - 1);
    if (file_.style() == OutputStyle::kJson) {
      const nlohmann::ordered_json json{{"output", output_},
                                        {"frames", written_},
                                        {"fps", fps_},
                                        {"width_px", picture_.request().width_px},
                                        {"height_px", picture_.request().height_px},
                                        {"ms", ms}};
      std::printf("%s\n",
                  json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
    } else if (file_.verbosity() != Verbosity::kQuiet) {
      std::printf("%s to %s: %zu pictures of %d x %d pixels, %.1f ms, %.1f a second\n",
                  frame_name(output_, 0)->c_str(), last.c_str(), written_, picture_.request().width_px,
                  picture_.request().height_px, ms, 1000.0 * double(written_) / ms);
    }
  }

  FileOptions file_;
  PictureOptions picture_;
  std::string output_;
  std::string animation_ = "0";
  double fps_ = 30.0;
  std::size_t frames_ = 0;
  double start_s_ = 0.0;
  std::string wrap_ = "loop";

  std::shared_ptr<const scene::Scene> scene_;
  scene::ElementRef choice_;
  std::size_t written_ = 0;
};

}  // namespace

std::unique_ptr<Command> make_play_command(CLI::App& program) {
  return std::make_unique<PlayCommand>(
      *program.add_subcommand("play", "Render an animation as a numbered sequence of pictures"));
}

}  // namespace gridcast::server
