#pragma once

#include <cmath>
#include <cstdint>

#include "core/math/affine.h"
#include "core/math/bounds.h"
#include "core/math/ray.h"

namespace gridcast::mesh {

struct ExactRay;

/// A vector in a register's worth of memory, so that one store writes it.
struct alignas(16) PaddedVec3f : Vec3f {
  using Vec3f::operator=;
  float padding;
};

/// A ray prepared for one mesh, in the mesh's object space. It has two halves:
///
/// * the exact half (double): the ray as transformed, and the shear of the triangle test. It decides.
/// * the culling half (float): a shifted and scaled copy of the ray whose box test is conservative.
///   It only skips what provably cannot win, so answers do not depend on the structure that culls.
///
/// The culling half measures distance as s = t * cull_scale - cull_shift: the direction is scaled so
/// that its largest component is 1, and unless the origin is near the mesh it is moved to where the ray
/// enters the mesh's box (or to tnear when that is later), so that floats have their full resolution there.
/// Every hit has s
/// >= 0.
/// Derivation of the pad: core/README.md, "Why culling never loses a hit".
struct ObjectRay {
  // Exact half.
  Vec3d origin;
  Vec3d direction;
  double tnear;
  int kx, ky, kz;      ///< kz: axis of the largest direction component; kx, ky follow it cyclically
  Vec3d axes_origin;   ///< origin[kx], origin[ky], origin[kz]
  double direction_z;  ///< direction[kz]
  double shear_x, shear_y;
  double distance;    ///< upper bound of |p - origin| per axis over the mesh
  double side_error;  ///< bound of the rounding of any edge function of the mesh (see triangle_test.cpp)
  std::uint32_t instance_id;
  std::uint32_t excluded_primitive;  ///< never hit: the triangle a secondary ray starts on; kInvalidId = none

  // Culling half.
  double cull_scale, cull_shift;
  PaddedVec3f cull_origin;
  PaddedVec3f cull_direction;
  Vec3f cull_axes_origin;  ///< cull_origin[kx], cull_origin[ky], cull_origin[kz]
  PaddedVec3f
      inverse_direction;  ///< finite: components below 2^-24 are moved away from 0, which the pad covers
  PaddedVec3f
      near_offset;  ///< s at the near plane b of an axis is b * inverse_direction + near_offset, at most
  PaddedVec3f far_offset;  ///< s at the far plane b is b * inverse_direction + far_offset, at least
  float pad;               ///< how far (object units, per axis) a hit point may lie from its triangle's box

  const ExactRay* exact;  ///< what `exact` mode knows beside; other modes neither set nor read it

  /// False when the ray was seen to miss `bounds` between tnear and tfar (then *this is unspecified).
  /// `ray` is in object space and valid; `bounds` holds every vertex of the mesh.
  bool prepare(const Ray& ray, const Bounds3f& bounds);
  /// The same for a ray that stands for another: at every t of a hit, a point of the one lies within `drift`
  /// (per axis) of the other's.
  bool prepare(const Ray& ray, const Bounds3f& bounds, double drift);
  /// The same for a ray in world space, up to `far`, and an instance of the mesh. In one step, since the ray
  /// in object space would be stored number by number and loaded by twos, which waits for the stores.
  bool prepare(const Ray& ray, double far, const InstanceTransform& transform, const Bounds3f& bounds);

  /// Upper bound of s at t: nothing at distance t or less lies beyond it.
  [[nodiscard]] float cull_far(double t) const {
    const double s = t * cull_scale - cull_shift;
    return float(s + std::abs(s) * 0x1p-22) + pad;
  }

 private:
  template <class Drift>
  [[gnu::always_inline]] bool prepare_with(const Ray& ray, const Bounds3f& bounds, Drift drift);
  template <class Drift>
  bool prepare_far(const Ray& ray, const Bounds3f& bounds, double box_size, Drift drift);
};

/// Conservative slab test: true unless no point of a triangle inside `box` can be an accepted hit with
/// s in [0, s_far]. Sets `s_enter`, a lower bound of s of any such hit. Monotone: a box inside
/// another never passes where the outer one fails, nor enters earlier. "Robust BVH Ray Traversal", T. Ize,
/// 2013, is the idea; unlike the paper we pad by an absolute distance, which also absorbs the rounding of the
/// origin and of zero direction components.
inline bool intersect_box(const ObjectRay& ray, const Vec3f& lower, const Vec3f& upper, float s_far,
                          float& s_enter) {
  float enter = 0.F;
  float exit = s_far;
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = ray.inverse_direction[axis];
    const float near_plane = inverse >= 0.F ? lower[axis] : upper[axis];
    const float far_plane = inverse >= 0.F ? upper[axis] : lower[axis];
    enter = std::max(enter, near_plane * inverse + ray.near_offset[axis]);
    exit = std::min(exit, far_plane * inverse + ray.far_offset[axis]);
  }
  s_enter = enter;
  return enter <= exit;
}

}  // namespace gridcast::mesh
