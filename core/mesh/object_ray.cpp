#include "core/mesh/object_ray.h"

namespace gridcast::mesh {
namespace {

/// |x| at least `smallest`, keeping the sign of x (+ for +0 and -0 alike would do: the pad covers both).
double away_from_zero(double x, double smallest) {
  return std::abs(x) < smallest ? std::copysign(smallest, x) : x;
}

struct Interval {
  double enter, exit;
};

/// Where o + s * d crosses the box, in double and padded by `pad` on every side.
Interval clip(const Vec3d& o, const Vec3d& d, const Bounds3f& box, double pad) {
  Interval s{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  for (int axis = 0; axis < 3; ++axis) {
    // 2^-52: smaller components move the ray by less than the pad over the length of the box.
    const double inverse = 1.0 / away_from_zero(d[axis], 0x1p-52);
    const double a = (double(box.lower[axis]) - pad - o[axis]) * inverse;
    const double b = (double(box.upper[axis]) + pad - o[axis]) * inverse;
    s.enter = std::max(s.enter, std::min(a, b));
    s.exit = std::min(s.exit, std::max(a, b));
  }
  return s;
}

void prepare_shear(ObjectRay& ray) {
  const Vec3d size = glm::abs(ray.direction);
  ray.kz = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  ray.kx = ray.kz == 2 ? 0 : ray.kz + 1;
  ray.ky = ray.kx == 2 ? 0 : ray.kx + 1;
  ray.shear_x = ray.direction[ray.kx] / ray.direction[ray.kz];
  ray.shear_y = ray.direction[ray.ky] / ray.direction[ray.kz];
}

}  // namespace

bool ObjectRay::prepare(const Ray& ray, const Bounds3f& bounds) {
  if (bounds.empty()) return false;
  origin = ray.origin;
  direction = ray.direction;
  tnear = ray.tnear;
  instance_id = 0;
  excluded_primitive = kInvalidId;
  prepare_shear(*this);

  // Scale to a largest component of 1, clip to the mesh's box in double, and reject a miss early.
  cull_scale = max_abs(direction);
  const Vec3d d = direction / cull_scale;
  const double box_size = double(bounds.magnitude());
  const double origin_size = max_abs(origin);
  distance = origin_size + box_size;
  side_error = 0x1p-45 * distance * distance;
  const double clip_pad = 0x1p-46 * distance + 0x1p-100;
  const Interval s = clip(origin, d, bounds, clip_pad);
  const double s_near = tnear * cull_scale;
  const double s_far = ray.tfar * cull_scale;
  // The slack covers the rounding of s itself, of tnear and tfar times scale, and the clamped components.
  const double slack = clip_pad + 0x1p-46 * (std::abs(s.enter) + std::abs(s.exit));
  if (!(s.enter <= s.exit + slack && s.enter <= s_far + slack && s_near <= s.exit + slack)) return false;

  // Move the origin to the point of the box's interval nearest to it.
  cull_shift = s.enter > 0.0 ? s.enter : (s.exit < 0.0 ? s.exit : 0.0);
  const Vec3d o = origin + cull_shift * d;
  const double size = max_abs(o) + box_size + 0x1p-24 * (origin_size + std::abs(cull_shift));
  pad = float(0x1p-19 * size + 0x1p-100);
  for (int axis = 0; axis < 3; ++axis) {
    cull_origin[axis] = float(o[axis]);
    cull_direction[axis] = float(d[axis]);
    inverse_direction[axis] = float(1.0 / away_from_zero(d[axis], 0x1p-24));
    const float offset = -(cull_origin[axis] * inverse_direction[axis]);
    const float margin = pad * std::abs(inverse_direction[axis]);
    near_offset[axis] = offset - margin;
    far_offset[axis] = offset + margin;
  }
  const double near = s_near - cull_shift;
  cull_near = float(near - std::abs(near) * 0x1p-22) - pad;
  return true;
}

}  // namespace gridcast::mesh
