#include "server/picture.h"

#include <numbers>
#include <string>
#include <utility>

#include "core/io/image.h"
#include "core/render/camera.h"

namespace gridcast::server {
namespace {

Result<scene::Camera> camera_of_file(const scene::Scene& scene, std::uint32_t index) {
  const std::vector<scene::Camera>& cameras = scene.data().cameras;
  if (index >= cameras.size())
    return Error{ErrorCode::kInvalidArgument,
                 "the scene's file has " + std::to_string(cameras.size()) + " cameras", "/camera"};
  if (!render::is_usable(cameras[index]))
    return Error{ErrorCode::kInvalidArgument, "this camera of the file cannot see anything", "/camera"};
  return cameras[index];
}

Result<scene::Camera> camera_at(const proto::LookAtCamera& view) {
  auto camera = render::look_at(view.eye, view.target, view.up, view.yfov_deg * std::numbers::pi / 180.0);
  if (camera) return camera;
  Error error = camera.error();
  error.where = error.where == "/yfov_rad" ? "/camera/yfov_deg" : "/camera" + error.where;
  return error;
}

}  // namespace

Result<scene::Camera> choose_camera(const scene::Scene& scene, const proto::CameraChoice& choice,
                                    double aspect_ratio) {
  if (const auto* file = std::get_if<proto::FileCamera>(&choice)) return camera_of_file(scene, file->index);
  if (const auto* view = std::get_if<proto::LookAtCamera>(&choice)) return camera_at(*view);
  return render::default_camera(scene, aspect_ratio);
}

Result<render::RenderSettings> render_settings(const scene::Scene& scene,
                                               const proto::RenderRequest& request) {
  auto camera = choose_camera(scene, request.camera, double(request.width_px) / double(request.height_px));
  if (!camera) return camera.error();
  auto integrator = render::parse_integrator(request.integrator);
  if (!integrator) return integrator.error();
  render::RenderSettings settings;
  settings.camera = std::move(camera).value();
  settings.width_px = request.width_px;
  settings.height_px = request.height_px;
  settings.integrator = *integrator;
  for (const std::string& name : request.layers) {
    auto layer = render::parse_layer(name);
    if (!layer) return layer.error();
    settings.layers.push_back(*layer);
  }
  settings.samples = request.samples;
  settings.max_depth = request.max_depth;
  settings.precision = request.precision;
  settings.mask = request.mask;
  if (Status valid = validate(settings); !valid) return valid.error();
  return settings;
}

Result<std::vector<std::byte>> encode_picture(const render::Film& film, proto::ImageFormat format,
                                              const std::stop_token& stop) {
  if (film.layers.empty()) return Error{ErrorCode::kInternal, "a picture without layers", ""};
  return format == proto::ImageFormat::kExr ? io::encode_exr(film, stop)
                                            : io::encode_png(film, film.layers.front(), stop);
}

}  // namespace gridcast::server
