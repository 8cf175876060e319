#include "core/math/affine.h"

#include <limits>

#include <glm/matrix.hpp>

namespace gridcast {
namespace {

inline Mat3d abs(const Mat3d& m) {
  return {glm::abs(m[0]), glm::abs(m[1]), glm::abs(m[2])};
}

bool is_finite(const Mat3d& m) {
  return gridcast::is_finite(m[0]) && gridcast::is_finite(m[1]) && gridcast::is_finite(m[2]);
}

double largest_entry(const Mat3d& m) {
  return std::max({max_abs(m[0]), max_abs(m[1]), max_abs(m[2])});
}

/// The row sums of |a||inverse| are |a| times those of |inverse|.
double condition_of(const Mat3d& a, const Mat3d& inverse) {
  return max_abs(abs(a) * (glm::abs(inverse[0]) + glm::abs(inverse[1]) + glm::abs(inverse[2])));
}

/// See InstanceTransform::round_trip_error. With u = 2^-53: the computed a * inverse is off by at most
/// 3u |a||inverse|, subtracting the identity by u more of the same, and applying the inverse to a vector
/// rounds by another 3u |inverse||v| (4u with the subtraction of the translation). 12u covers all.
double round_trip_error_of(const Mat3d& a, const Mat3d& inverse, double condition) {
  return row_sum_norm(a * inverse - Mat3d(1.0)) + 12.0 * 0x1p-53 * condition + 0x1p-52;
}

}  // namespace

InstanceTransform::InstanceTransform(const Affine& world_from_object)
    : world_from_object_(world_from_object) {
  round_trip_error_ = std::numeric_limits<double>::infinity();
  const Mat3d& a = world_from_object.linear;
  const Vec3d& t = world_from_object.translation;
  if (!is_finite(a) || !gridcast::is_finite(t) || max_abs(t) > kMaxTranslation) return;

  const double largest = largest_entry(a);
  if (!(largest >= kMinScale && largest <= kMaxScale)) return;
  // The determinant of what passes is above 2^-435, since that of its inverse is at most 6 kMaxInverse^3.
  const Mat3d inverse = glm::inverse(a);
  if (!is_finite(inverse) || !(row_sum_norm(inverse) <= kMaxInverse)) return;

  const double condition = condition_of(a, inverse);
  if (!(condition <= kMaxCondition)) return;
  const double round_trip_error = round_trip_error_of(a, inverse, condition);
  if (!(round_trip_error <= kMaxRoundTripError)) return;
  object_from_world_linear_ = inverse;
  round_trip_error_ = round_trip_error;
}

double InstanceTransform::condition() const {
  return condition_of(world_from_object_.linear, object_from_world_linear_);
}

// Nothing here leaves the range of doubles: the inverse has entries up to kMaxInverse, 2^143, and makes no
// vector shorter than a 2^103rd of it, so squares of the components lie between 2^-808 and 2^890.
Vec3d InstanceTransform::normal_to_world(const Vec3d& n) const {
  return glm::normalize(glm::transpose(object_from_world_linear_) * n);
}

Bounds3d InstanceTransform::bounds_to_world(const Bounds3f& object) const {
  if (object.empty()) return {};
  const Vec3d center = 0.5 * (Vec3d(object.lower) + Vec3d(object.upper));
  // Half the extent, grown so that center +- half covers lower and upper in spite of rounding.
  const Vec3d half = (0.5 * (Vec3d(object.upper) - Vec3d(object.lower))) * (1.0 + 0x1p-50) +
                     Vec3d(0x1p-50 * double(object.magnitude()));
  const Vec3d world_center = world_from_object_.point(center);
  const Vec3d world_half = abs(world_from_object_.linear) * half;
  // Each sum above has at most four terms: 8 roundings of 2^-53 relative to the sum of magnitudes.
  const Vec3d magnitude =
      abs(world_from_object_.linear) * (glm::abs(center) + half) + glm::abs(world_from_object_.translation);
  const Vec3d outward = 0x1p-50 * magnitude;
  return {world_center - world_half - outward, world_center + world_half + outward};
}

}  // namespace gridcast
