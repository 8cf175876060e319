#include "server/cli/cast_rays.h"

#include <memory>
#include <span>
#include <utility>

#include "core/render/camera.h"
#include "core/render/render.h"
#include "server/cli/input.h"
#include "server/cli/vector_option.h"

namespace gridcast::server {
namespace {

/// A file is the user's own: the limits against strangers do not apply, the depth of JSON still does.
proto::Limits file_limits() {
  proto::Limits limits;
  limits.json_bytes = limits.binary_bytes = kMaxRayFileBytes;
  limits.json_rays = limits.binary_rays = std::size_t(1) << 31;
  return limits;
}

Status parse_bytes(RaySet& rays, const std::string& content_type) {
  auto parsed = proto::parse_ray_request(content_type, rays.bytes, {}, file_limits());
  if (!parsed) return Error{ErrorCode::kInvalidFile, parsed.problem().detail, parsed.problem().pointer};
  rays.request = std::move(parsed).value();
  return ok_status();
}

void camera_rays(RaySet& rays, const scene::Scene& scene, int width_px, int height_px) {
  const scene::Camera camera = render::default_camera(scene, double(width_px) / double(height_px));
  rays.rows.reserve(std::size_t(width_px) * std::size_t(height_px) * 6);
  for (int y = 0; y < height_px; ++y)
    for (int x = 0; x < width_px; ++x) {
      const Ray ray = render::primary_ray(camera, width_px, height_px, x + 0.5, y + 0.5);
      for (const Vec3d& v : {ray.origin, ray.direction}) rays.rows.insert(rays.rows.end(), {v.x, v.y, v.z});
    }
  rays.request.binary_body = std::as_bytes(std::span(rays.rows));
  rays.request.scalar = ScalarType::kFloat64;
  rays.request.columns = 6;
}

}  // namespace

Result<std::unique_ptr<RaySet>> read_rays(const RaySource& source, const scene::Scene& scene,
                                          const std::stop_token& stop) {
  auto rays = std::make_unique<RaySet>();
  if (!source.camera_grid.empty()) {
    const auto size = parse_size(source.camera_grid);
    if (!size) return Error{ErrorCode::kInvalidArgument, "a grid is WIDTHxHEIGHT", "--camera-grid"};
    camera_rays(*rays, scene, size->first, size->second);
    return rays;
  }
  const bool is_json = !source.json_path.empty();
  auto bytes = read_input(is_json ? source.json_path : source.binary_path, kMaxRayFileBytes, stop);
  if (!bytes) return bytes.error();
  rays->bytes = std::move(bytes).value();
  const std::string content_type = is_json ? "application/json"
                                           : "application/vnd.gridcast.rays; dtype=" + source.scalar +
                                                 "; columns=" + std::to_string(source.columns);
  if (const Status parsed = parse_bytes(*rays, content_type); !parsed) return parsed.error();
  return rays;
}

}  // namespace gridcast::server
