#include "server/cli/picture_options.h"

#include <charconv>
#include <filesystem>
#include <vector>

#include "proto/vocabulary.h"
#include "server/cli/common.h"
#include "server/cli/vector_option.h"

namespace gridcast::server {
namespace {

std::vector<std::string> words(auto const& names) {
  return {names.begin(), names.end()};
}

}  // namespace

void PictureOptions::add_to(CLI::App& app) {
  app.add_option("--width", request_.width_px, "Pixels")->capture_default_str()->check(CLI::Range(1, 16384));
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
  masks_.add_to(app);
}

std::optional<std::string> PictureOptions::read(const std::string& output) {
  const std::string ending = std::filesystem::path(output).extension().string();
  if (ending != ".png" && ending != ".exr") return "the output's name must end in .png or .exr";
  request_.format = ending == ".exr" ? proto::ImageFormat::kExr : proto::ImageFormat::kPng;
  if (!request_.layers.empty() && ending == ".png") return "--layers needs an .exr";
  request_.precision = parse_precision(precision_).value();
  if (auto wrong = masks_.read()) return wrong;
  request_.mask = masks_.mask();
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

std::optional<std::string> PictureOptions::read_view() {
  const auto eye = parse_vector(eye_);
  const auto target = parse_vector(target_);
  const auto up = parse_vector(up_);
  if (!eye || !target || !up) return "--eye, --target and --up are three finite numbers with commas: x,y,z";
  request_.camera = proto::LookAtCamera{*eye, *target, *up, yfov_deg_};
  return std::nullopt;
}

}  // namespace gridcast::server
