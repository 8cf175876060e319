#include "core/mesh/object_ray.h"

namespace gridcast::mesh {
namespace {

struct Interval {
  double enter, exit;
};

/// Where o + s / inverse crosses the box, in double and padded by `pad` on every side.
Interval clip(const Vec3d& o, const Vec3d& inverse, const Bounds3f& box, double pad) {
  Interval s{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (double(box.lower[axis]) - pad - o[axis]) * inverse[axis];
    const double b = (double(box.upper[axis]) + pad - o[axis]) * inverse[axis];
    s.enter = std::max(s.enter, std::min(a, b));
    s.exit = std::min(s.exit, std::max(a, b));
  }
  return s;
}

void choose_axes(ObjectRay& ray) {
  const Vec3d size = glm::abs(ray.direction);
  ray.kz = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  ray.kx = ray.kz == 2 ? 0 : ray.kz + 1;
  ray.ky = ray.kx == 2 ? 0 : ray.kx + 1;
}

/// 1 / x, at most `largest` in size, with the sign of x (that of a zero does not matter: the pad covers
/// both).
double bounded_inverse(double x, double largest) {
  return std::abs(x) * largest > 1.0 ? 1.0 / x : std::copysign(largest, x);
}

}  // namespace

bool ObjectRay::prepare(const Ray& ray, const Bounds3f& bounds) {
  if (bounds.empty()) return false;
  origin = ray.origin;
  direction = ray.direction;
  tnear = ray.tnear;
  instance_id = 0;
  excluded_primitive = kInvalidId;
  choose_axes(*this);
  const double inverse_z = 1.0 / direction[kz];
  shear_x = direction[kx] * inverse_z;
  shear_y = direction[ky] * inverse_z;

  // Scale to a largest component of 1 (within two roundings), clip to the mesh's box in double, and reject a
  // miss early. Components below 2^-52 count as 2^-52, which moves the ray by less than the pad over the
  // length of the box.
  cull_scale = std::abs(direction[kz]);
  const Vec3d d = direction * std::abs(inverse_z);
  Vec3d inverse;
  inverse[kx] = bounded_inverse(d[kx], 0x1p52);
  inverse[ky] = bounded_inverse(d[ky], 0x1p52);
  inverse[kz] = std::copysign(1.0, direction[kz]);
  const double box_size = double(bounds.magnitude());
  const double origin_size = max_abs(origin);
  distance = origin_size + box_size;
  side_error = 0x1p-45 * distance * distance;
  const double clip_pad = 0x1p-46 * distance + 0x1p-100;
  const Interval s = clip(origin, inverse, bounds, clip_pad);
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
    inverse_direction[axis] = float(std::clamp(inverse[axis], -0x1p24, 0x1p24));
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
