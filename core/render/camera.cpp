#include "core/render/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace gridcast::render {
namespace {

// Where a scene without a camera is looked at from: the front, a little above and to the right.
const Vec3d kViewFrom = glm::normalize(Vec3d(0.55, 0.42, 1.0));
// Room between the framed box and the edge of the picture.
constexpr double kFrameMargin = 1.06;

// The columns are the camera's axes in world space; it looks along its -z.
Mat3d axes(const Vec3d& backward, const Vec3d& up) {
  const Vec3d z = glm::normalize(backward);
  const Vec3d x = glm::normalize(glm::cross(up, z));
  return {x, glm::cross(z, x), z};
}

struct HalfSize {
  double x, y;
};

// Pixels are square whatever the camera's own shape: the picture shows all that the camera frames, and more
// along one side where the shapes differ.
HalfSize fit(HalfSize camera, double picture_aspect) {
  if (camera.x < camera.y * picture_aspect) return {camera.y * picture_aspect, camera.y};
  return {camera.x, camera.x / picture_aspect};
}

HalfSize half_size(const scene::Camera& camera, double picture_aspect) {
  if (camera.kind == scene::CameraKind::kOrthographic) return fit({camera.xmag, camera.ymag}, picture_aspect);
  const double y = std::tan(0.5 * camera.yfov_rad);
  return fit({y * camera.aspect_ratio.value_or(picture_aspect), y}, picture_aspect);
}

Error invalid(std::string message, std::string where) {
  return {ErrorCode::kInvalidArgument, std::move(message), std::move(where)};
}

}  // namespace

Result<scene::Camera> look_at(const Vec3d& eye, const Vec3d& target, const Vec3d& up, double yfov_rad) {
  if (!is_finite(eye)) return invalid("the eye is not finite", "/eye");
  if (!is_finite(target)) return invalid("the target is not finite", "/target");
  if (!is_finite(up)) return invalid("the up vector is not finite", "/up");
  if (!(yfov_rad > 0.0 && yfov_rad < std::numbers::pi))
    return invalid("the field of view must lie between 0 and pi", "/yfov_rad");
  // Scaled to 1 first, so that neither far nor near targets leave the range of double.
  const double distance = max_abs(eye - target);
  if (!(distance > 0.0) || !std::isfinite(distance))
    return invalid("the target must differ from the eye", "/target");
  if (!(max_abs(up) > 0.0)) return invalid("the up vector is zero", "/up");
  const Vec3d backward = glm::normalize((eye - target) / distance);
  const Vec3d upward = glm::normalize(up / max_abs(up));
  if (glm::length(glm::cross(upward, backward)) < 1e-9)
    return invalid("the up vector is parallel to the view", "/up");

  scene::Camera camera;
  camera.yfov_rad = yfov_rad;
  camera.world_from_camera = {axes(backward, upward), eye};
  return camera;
}

scene::Camera frame(const Bounds3d& bounds, double yfov_rad, double aspect_ratio) {
  scene::Camera camera;
  camera.yfov_rad = yfov_rad > 0.0 && yfov_rad < std::numbers::pi ? yfov_rad : 0.7;
  camera.aspect_ratio = aspect_ratio > 0.0 && std::isfinite(aspect_ratio) ? aspect_ratio : 1.0;
  const bool has_size = !bounds.empty() && is_finite(bounds.lower) && is_finite(bounds.upper);
  const Bounds3d box = has_size ? bounds : Bounds3d{Vec3d(-1.0), Vec3d(1.0)};

  // The nearest distance at which every corner lies inside the view, per side: a corner at (x, y, z) from
  // the centre needs distance - z >= |x| / tangent.
  const Mat3d linear = axes(kViewFrom, {0.0, 1.0, 0.0});
  const double tangent_y = std::tan(0.5 * camera.yfov_rad) / kFrameMargin;
  const double tangent_x = tangent_y * *camera.aspect_ratio;
  double distance = 0.0;
  for (int i = 0; i < 8; ++i) {
    const Vec3d sign((i & 1) != 0 ? 0.5 : -0.5, (i & 2) != 0 ? 0.5 : -0.5, (i & 4) != 0 ? 0.5 : -0.5);
    const Vec3d corner = glm::transpose(linear) * (sign * box.extent());
    distance = std::max(
        {distance, corner.z + std::abs(corner.x) / tangent_x, corner.z + std::abs(corner.y) / tangent_y});
  }
  if (!(distance > 0.0)) distance = 1.0;
  camera.world_from_camera = {linear, box.center() + distance * kViewFrom};
  return camera;
}

bool is_usable(const scene::Camera& camera) {
  const Affine& place = camera.world_from_camera;
  if (!is_finite(place.translation) || max_abs(place.translation) > kMaxRayOrigin) return false;
  const double determinant = glm::determinant(place.linear);
  if (!std::isfinite(determinant) || std::abs(std::abs(determinant) - 1.0) > 1e-3) return false;
  if (camera.kind == scene::CameraKind::kOrthographic) {
    return camera.xmag > 0.0 && camera.ymag > 0.0 && std::isfinite(camera.xmag) && std::isfinite(camera.ymag);
  }
  const double aspect = camera.aspect_ratio.value_or(1.0);
  return camera.yfov_rad > 0.0 && camera.yfov_rad < std::numbers::pi && aspect > 0.0 && std::isfinite(aspect);
}

Ray primary_ray(const scene::Camera& camera, int width_px, int height_px, double x_px, double y_px) {
  const HalfSize half = half_size(camera, double(width_px) / double(height_px));
  const double x = (2.0 * x_px / double(width_px) - 1.0) * half.x;
  const double y = (1.0 - 2.0 * y_px / double(height_px)) * half.y;
  const Affine& place = camera.world_from_camera;
  Ray ray;
  if (camera.kind == scene::CameraKind::kOrthographic) {
    ray.origin = place.point({x, y, 0.0});
    ray.direction = glm::normalize(place.vector({0.0, 0.0, -1.0}));
  } else {
    ray.origin = place.translation;
    ray.direction = glm::normalize(place.vector({x, y, -1.0}));
  }
  return ray;
}

}  // namespace gridcast::render
