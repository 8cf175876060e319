#include "core/mesh/object_ray.h"

#include <bit>
#include <cstring>
#include <limits>

namespace gridcast::mesh {
namespace {

using Double2 [[gnu::vector_size(16)]] = double;
using Float2 [[gnu::vector_size(8)]] = float;
using Long2 [[gnu::vector_size(16)]] = std::int64_t;
using Float4 [[gnu::vector_size(16)]] = float;
using Int4 [[gnu::vector_size(16)]] = std::int32_t;

Double2 min(Double2 a, Double2 b) {
  return a < b ? a : b;
}
Double2 max(Double2 a, Double2 b) {
  return a > b ? a : b;
}
Double2 abs(Double2 v) {
  return Double2(Long2(v) & std::numeric_limits<std::int64_t>::max());
}
Double2 copy_sign(Double2 size, Double2 sign) {
  return Double2(Long2(size) | (Long2(sign) & std::numeric_limits<std::int64_t>::min()));
}

/// A vector as lanes x, y, z, z: all axes at once, and the largest of them without a mask. Signs and axes of
/// rays are random, so a branch on them would be mispredicted and cost as much as a third of prepare.
struct Axes {
  Double2 xy, zz;

  Axes(Double2 first, Double2 second) : xy(first), zz(second) {}
  template <class T>
  explicit Axes(const glm::vec<3, T, glm::defaultp>& v)
      : xy{double(v.x), double(v.y)}, zz{double(v.z), double(v.z)} {}

  friend Axes operator+(const Axes& a, const Axes& b) { return {a.xy + b.xy, a.zz + b.zz}; }
  friend Axes operator-(const Axes& a, const Axes& b) { return {a.xy - b.xy, a.zz - b.zz}; }
  friend Axes operator*(const Axes& a, const Axes& b) { return {a.xy * b.xy, a.zz * b.zz}; }
  friend Axes operator+(const Axes& a, double b) { return {a.xy + b, a.zz + b}; }
  friend Axes operator-(const Axes& a, double b) { return {a.xy - b, a.zz - b}; }
  friend Axes operator*(double a, const Axes& b) { return {a * b.xy, a * b.zz}; }
  friend Axes operator/(double a, const Axes& b) { return {a / b.xy, a / b.zz}; }
  friend Axes min(const Axes& a, const Axes& b) { return {min(a.xy, b.xy), min(a.zz, b.zz)}; }
  friend Axes max(const Axes& a, const Axes& b) { return {max(a.xy, b.xy), max(a.zz, b.zz)}; }
  friend Axes abs(const Axes& a) { return {abs(a.xy), abs(a.zz)}; }
  friend Axes copy_sign(const Axes& size, const Axes& sign) {
    return {copy_sign(size.xy, sign.xy), copy_sign(size.zz, sign.zz)};
  }
  [[nodiscard]] double largest() const { return max(max(xy, __builtin_shufflevector(xy, xy, 1, 0)), zz)[0]; }
  [[nodiscard]] double smallest() const { return min(min(xy, __builtin_shufflevector(xy, xy, 1, 0)), zz)[0]; }
  [[nodiscard]] Float4 to_float() const {
    return __builtin_shufflevector(__builtin_convertvector(xy, Float2), __builtin_convertvector(zz, Float2),
                                   0, 1, 2, 3);
  }
};

void store(Float4 v, PaddedVec3f& out) {
  std::memcpy(&out, &v, sizeof(out));
}
Float4 clamp(Float4 v, float limit) {
  const Float4 high = {limit, limit, limit, limit};
  v = v < high ? v : high;
  return v > -high ? v : -high;
}

/// The first axis on which `size` is `largest`, by the order of the bits of positive doubles.
int first_largest(const Axes& size, double largest) {
  const auto bits = std::bit_cast<std::uint64_t>(largest);
  const auto not_x = (std::bit_cast<std::uint64_t>(size.xy[0]) - bits) >> 63U;
  const auto not_y = (std::bit_cast<std::uint64_t>(size.xy[1]) - bits) >> 63U;
  return int(not_x + (not_x & not_y));
}

constexpr int kNextAxis[3] = {1, 2, 0};

/// The float half of a ray whose origin was moved to `o`; `d` has a largest component of 1.
void set_cull_half(ObjectRay& ray, const Axes& o, const Axes& d, Float4 inverse) {
  const Float4 float_origin = o.to_float();
  const Float4 bounded = clamp(inverse, 0x1p24F);
  const Float4 offset = -(float_origin * bounded);
  const Float4 margin = ray.pad * Float4(Int4(bounded) & 0x7FFFFFFF);
  store(float_origin, ray.cull_origin);
  store(d.to_float(), ray.cull_direction);
  store(bounded, ray.inverse_direction);
  store(offset - margin, ray.near_offset);
  store(offset + margin, ray.far_offset);
  ray.cull_axes_origin = {component(ray.cull_origin, ray.kx), component(ray.cull_origin, ray.ky),
                          component(ray.cull_origin, ray.kz)};
}

/// An origin within so many mesh sizes stays where it is.
constexpr double kNear = 3.0;

/// A ray that stands for itself, and one that stands for another. A drift of d takes 2 d of the float bounds
/// of an edge function's corner (pad / 4, see block_filter-inl.h), hence 8 d of pad; twice that, as the pad
/// is rounded to float. A drift too small to change the pad fits the room that those bounds have.
struct NoDrift {
  [[nodiscard]] static double widen(double pad) { return pad; }
};
struct SomeDrift {
  double drift;
  [[nodiscard]] double widen(double pad) const { return pad + 16.0 * drift; }
};

}  // namespace

template <class Drift>
inline bool ObjectRay::prepare_with(const Ray& ray, const Bounds3f& bounds, Drift drift) {
  origin = ray.origin;
  direction = ray.direction;
  tnear = ray.tnear;
  instance_id = 0;
  excluded_primitive = kInvalidId;

  const Axes dir(direction);
  const Axes dir_size = abs(dir);
  cull_scale = dir_size.largest();
  const double inverse_scale = 1.0 / cull_scale;
  kz = first_largest(dir_size, cull_scale);
  kx = kNextAxis[kz];
  ky = kNextAxis[kx];
  axes_origin = {component(origin, kx), component(origin, ky), component(origin, kz)};
  direction_z = component(direction, kz);
  const double inverse_z = std::copysign(inverse_scale, direction_z);
  shear_x = component(direction, kx) * inverse_z;
  shear_y = component(direction, ky) * inverse_z;

  const Axes start(origin);
  const double box_size = max(abs(Axes(bounds.lower)), abs(Axes(bounds.upper))).largest();
  const double origin_size = abs(start).largest();
  distance = origin_size + box_size;
  side_error = 0x1p-45 * distance * distance;
  if (!(tnear == 0.0 && origin_size <= kNear * box_size)) return prepare_far(ray, bounds, box_size, drift);

  // The common case, at a third of the cost: s = t * cull_scale, and the root of the tree tests the box.
  cull_shift = 0.0;
  pad = float(drift.widen(0x1p-19 * distance + 0x1p-100));
  const Axes d = inverse_scale * dir;
  set_cull_half(*this, start, d, 1.F / d.to_float());
  return bounds.lower.x <= bounds.upper.x;
}

template <class Drift>
bool ObjectRay::prepare_far(const Ray& ray, const Bounds3f& bounds, double box_size, Drift drift) {
  // Clip to the mesh's box in double, and reject a miss early. Components below 2^-52 count as 2^-52, which
  // moves the ray by less than the pad over the length of the box.
  const Axes dir(direction);
  const Axes inverse = copy_sign(min(cull_scale / abs(dir), Axes(Vec3d(0x1p52))), dir);
  const Axes lower(bounds.lower), upper(bounds.upper), start(origin);
  // The box is grown by half the pad, so it holds what the triangle tests accept, `fast` included. Where the
  // range or the box ends, s is at most `distance` in size, and so is its rounding: that of the clip, of
  // tnear and tfar times the scale, and of the clamped components.
  pad = float(drift.widen(0x1p-19 * (2.0 * box_size + 0x1p-22 * distance) + 0x1p-100));
  const double slack = 0x1p-44 * distance + 0x1p-100;
  const double growth = 0.5 * double(pad) + slack;
  const Axes to_lower = (lower - start - growth) * inverse;
  const Axes to_upper = (upper - start + growth) * inverse;
  const double enter = min(to_lower, to_upper).largest();
  const double exit = max(to_lower, to_upper).smallest() + slack;
  const double s_near = tnear * cull_scale;
  const double s_far = ray.tfar * cull_scale;
  // An empty box gives infinities, then NaN, and the same answer.
  if (!(int(enter <= exit) & int(enter <= s_far + slack) & int(s_near <= exit))) return false;

  // Start where both the box and the range have begun: no hit has a negative s, and the origin lies in the
  // box grown by a few slacks.
  cull_shift = max(Double2{s_near, s_near}, Double2{enter - slack, enter - slack})[0];
  const Axes d = (1.0 / cull_scale) * dir;
  set_cull_half(*this, start + cull_shift * d, d, inverse.to_float());
  return true;
}

bool ObjectRay::prepare(const Ray& ray, const Bounds3f& bounds) {
  return prepare_with(ray, bounds, NoDrift{});
}

bool ObjectRay::prepare(const Ray& ray, const Bounds3f& bounds, double drift) {
  return prepare_with(ray, bounds, SomeDrift{drift});
}

bool ObjectRay::prepare(const Ray& ray, double far, const InstanceTransform& transform,
                        const Bounds3f& bounds) {
  const Ray object{transform.point_to_object(ray.origin), transform.vector_to_object(ray.direction),
                   ray.tnear, far};
  return prepare_with(object, bounds, NoDrift{});
}

}  // namespace gridcast::mesh
