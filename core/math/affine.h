#pragma once

#include "core/error.h"
#include "core/math/bounds.h"
#include "core/math/vec.h"

namespace gridcast {

/// p -> linear * p + translation. Column-major like glTF: linear[0] is the image of the x axis.
struct Affine {
  Mat3d linear{1.0};
  Vec3d translation{0.0};

  [[nodiscard]] Vec3d point(const Vec3d& p) const { return linear * p + translation; }
  [[nodiscard]] Vec3d vector(const Vec3d& v) const { return linear * v; }
  friend bool operator==(const Affine&, const Affine&) = default;
};

/// (a * b).point(p) = a.point(b.point(p)).
inline Affine operator*(const Affine& a, const Affine& b) {
  return {a.linear * b.linear, a.point(b.translation)};
}

// Limits of an active transform.
/// Largest condition(): beyond it the inverse has fewer than ten good bits.
inline constexpr double kMaxCondition = 0x1p43;
/// Largest round_trip_error(): beyond it the world boxes of instances stop being useful.
inline constexpr double kMaxRoundTripError = 0x1p-5;
/// Range of the largest entry of the linear part, and of the translation in metres: the exact arithmetic of
/// the triangle test relies on object-space rays in a bounded range (core/math/exact.h).
inline constexpr double kMinScale = 0x1p-100;
inline constexpr double kMaxScale = 0x1p100;
/// Largest row sum of the inverse: one that is flattened further sends object-space rays and normals out of
/// that range, however well conditioned it is.
inline constexpr double kMaxInverse = kMaxCondition / kMinScale;
inline constexpr double kMaxTranslation = 0x1p100;

/// world_from_object with its stored inverse. Mirrored, sheared and non-uniform scales are fine;
/// a singular matrix makes an inactive transform: nothing of it is ever hit.
class InstanceTransform {
 public:
  InstanceTransform() = default;
  /// Inactive when `world_from_object` is singular, not finite, out of range (kMinScale to kMaxScale,
  /// kMaxInverse, kMaxTranslation) or too ill conditioned to invert (kMaxCondition).
  explicit InstanceTransform(const Affine& world_from_object);

  [[nodiscard]] const Affine& world_from_object() const { return world_from_object_; }
  [[nodiscard]] const Mat3d& object_from_world_linear() const { return object_from_world_linear_; }
  [[nodiscard]] bool active() const { return round_trip_error_ <= kMaxRoundTripError; }

  /// World to object. The translation is subtracted first, in double, so an instance a million
  /// metres out is as accurate as one at the origin.
  [[nodiscard]] Vec3d point_to_object(const Vec3d& p) const {
    return object_from_world_linear_ * (p - world_from_object_.translation);
  }
  /// Not renormalised, so t stays comparable between instances.
  [[nodiscard]] Vec3d vector_to_object(const Vec3d& v) const { return object_from_world_linear_ * v; }
  /// Unit world normal of an object-space normal, whose largest component is between 2^-300 and 2^300 (cross
  /// products of edges of floats are): inverse transpose, normalised. Mirroring keeps the side: the normal
  /// follows the surface's winding in object space.
  [[nodiscard]] Vec3d normal_to_world(const Vec3d& n) const;

  /// Largest row sum of |A||B|, B the stored inverse of A: how much rounding errors grow on a round trip
  /// world -> object -> world.
  [[nodiscard]] double condition() const;
  /// e with |A point_to_object(p) + T - p| <= e |p - T| and |A vector_to_object(v) - v| <= e |v| for
  /// every p and v, A and T taken exactly, in the largest component. Measured from the stored inverse,
  /// not estimated from the condition. Infinite when inactive.
  [[nodiscard]] double round_trip_error() const { return round_trip_error_; }

  /// Conservative world box of `object` (outward by the rounding of this transform; empty stays empty).
  [[nodiscard]] Bounds3d bounds_to_world(const Bounds3f& object) const;

 private:
  friend class TransformRows;  // makes eight at once

  Affine world_from_object_;
  Mat3d object_from_world_linear_{1.0};
  double round_trip_error_ = 0x1p-49;
};

/// Largest row sum of absolute values: the factor by which m can enlarge a largest component.
[[nodiscard]] inline double row_sum_norm(const Mat3d& m) {
  return max_abs(glm::abs(m[0]) + glm::abs(m[1]) + glm::abs(m[2]));
}

}  // namespace gridcast
