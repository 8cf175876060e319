#include "core/sensor/pattern.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/render/camera.h"

namespace gridcast::sensor {
namespace {

struct Size {
  std::uint32_t rows, columns;
};

Size size(const Pinhole& camera) {
  return {camera.height_px, camera.width_px};
}
Size size(const Orthographic& camera) {
  return {camera.height_px, camera.width_px};
}
Size size(const Fisheye& camera) {
  return {camera.height_px, camera.width_px};
}
Size size(const Lidar& lidar) {
  return {std::uint32_t(lidar.elevations_rad.size()), lidar.azimuth_count};
}
Size size(const Grid& grid) {
  return {grid.rows, grid.columns};
}

scene::Camera camera_of(const Affine& place, const Pinhole& pinhole) {
  scene::Camera camera;
  camera.yfov_rad = pinhole.yfov_rad;
  camera.world_from_camera = place;
  return camera;
}
scene::Camera camera_of(const Affine& place, const Orthographic& flat) {
  scene::Camera camera;
  camera.kind = scene::CameraKind::kOrthographic;
  camera.ymag = 0.5 * flat.height_m;
  camera.xmag = camera.ymag * double(flat.width_px) / double(flat.height_px);
  camera.world_from_camera = place;
  return camera;
}

/// Through the centre of a pixel.
template <class Model>
Ray camera_ray(const Affine& place, const Model& model, std::uint32_t row, std::uint32_t column) {
  return render::primary_ray(camera_of(place, model), int(model.width_px), int(model.height_px),
                             double(column) + 0.5, double(row) + 0.5);
}

Ray towards(const Affine& place, const Vec3d& direction) {
  return {place.translation, glm::normalize(place.vector(direction))};
}

Ray model_ray(const Affine& place, const Pinhole& model, std::uint32_t row, std::uint32_t column) {
  return camera_ray(place, model, row, column);
}
Ray model_ray(const Affine& place, const Orthographic& model, std::uint32_t row, std::uint32_t column) {
  return camera_ray(place, model, row, column);
}
Ray model_ray(const Affine& place, const Fisheye& model, std::uint32_t row, std::uint32_t column) {
  const double diameter = double(std::min(model.width_px, model.height_px));
  const double x = (2.0 * double(column) + 1.0 - double(model.width_px)) / diameter;
  const double y = (double(model.height_px) - 2.0 * double(row) - 1.0) / diameter;
  const double radius = std::sqrt(x * x + y * y);
  if (radius > 1.0) return {place.translation, Vec3d(0.0)};
  if (radius == 0.0) return towards(place, {0.0, 0.0, -1.0});
  const double angle = 0.5 * model.fov_rad * radius;
  const double off_axis = std::sin(angle) / radius;
  return towards(place, {x * off_axis, y * off_axis, -std::cos(angle)});
}
Ray model_ray(const Affine& place, const Lidar& model, std::uint32_t row, std::uint32_t column) {
  const double elevation = model.elevations_rad[row];
  const double azimuth = model.azimuth_from_rad + double(column) * model.azimuth_step_rad;
  return towards(place, {-std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                         -std::cos(azimuth) * std::cos(elevation)});
}
Ray model_ray(const Affine& place, const Grid& model, std::uint32_t row, std::uint32_t column) {
  const Vec3d node{(double(column) - 0.5 * (double(model.columns) - 1.0)) * model.x_spacing_m,
                   (0.5 * (double(model.rows) - 1.0) - double(row)) * model.y_spacing_m, 0.0};
  return {place.point(node), glm::normalize(place.vector({0.0, 0.0, -1.0}))};
}

struct Complaint {
  const char* what;
  const char* where;
};

bool is_length(double value) {
  return value > 0.0 && std::isfinite(value);
}

std::optional<Complaint> complain(const Pinhole& model) {
  if (model.yfov_rad > 0.0 && model.yfov_rad < std::numbers::pi) return std::nullopt;
  return Complaint{"must lie between 0 and 180", "/yfov_deg"};
}
std::optional<Complaint> complain(const Orthographic& model) {
  if (is_length(model.height_m)) return std::nullopt;
  return Complaint{"must be positive", "/height"};
}
std::optional<Complaint> complain(const Fisheye& model) {
  if (model.fov_rad > 0.0 && model.fov_rad <= 2.0 * std::numbers::pi) return std::nullopt;
  return Complaint{"must be above 0 and at most 360", "/fov_deg"};
}
std::optional<Complaint> complain(const Lidar& model) {
  for (const double elevation : model.elevations_rad)
    if (!(std::abs(elevation) <= 0.5 * std::numbers::pi))
      return Complaint{"must lie from -90 to 90", "/elevations_deg"};
  if (!std::isfinite(model.azimuth_from_rad) || !std::isfinite(model.azimuth_step_rad))
    return Complaint{"must be finite", "/azimuth"};
  return std::nullopt;
}
std::optional<Complaint> complain(const Grid& model) {
  if (is_length(model.x_spacing_m) && is_length(model.y_spacing_m)) return std::nullopt;
  return Complaint{"must be positive", "/spacing"};
}

}  // namespace

Status check(const Sensor& sensor) {
  const auto invalid = [](const char* what, const char* where) {
    return Error{ErrorCode::kInvalidArgument, what, where};
  };
  scene::Camera anywhere;
  anywhere.world_from_camera = sensor.world_from_sensor;
  if (!render::is_usable(anywhere))
    return invalid("must be finite, without scale and not degenerate", "/pose");
  if (!(sensor.max_range > 0.0)) return invalid("must be positive", "/max_range");
  const auto complaint = std::visit([](const auto& model) { return complain(model); }, sensor.model);
  if (complaint) return invalid(complaint->what, complaint->where);
  return ok_status();
}

std::size_t ray_count(const Sensor& sensor) {
  const Size whole = std::visit([](const auto& model) { return size(model); }, sensor.model);
  const std::uint64_t count = std::uint64_t(whole.rows) * whole.columns;
  return count > (std::uint64_t(1) << 32U) ? 0 : std::size_t(count);
}

Ray ray(const Sensor& sensor, std::size_t i) {
  Ray made = std::visit(
      [&](const auto& model) {
        const std::size_t columns = size(model).columns;
        return model_ray(sensor.world_from_sensor, model, std::uint32_t(i / columns),
                         std::uint32_t(i % columns));
      },
      sensor.model);
  made.tfar = sensor.max_range;
  return made;
}

}  // namespace gridcast::sensor
