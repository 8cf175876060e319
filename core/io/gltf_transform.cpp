#include "core/io/gltf_transform.h"

#include <algorithm>
#include <cmath>

namespace gridcast::io {

Affine affine_from_trs(const Vec3d& translation, const std::array<double, 4>& rotation, const Vec3d& scale) {
  // Scaled by the largest part first, so that huge and tiny quaternions keep their direction.
  double largest = 0.0;
  for (const double part : rotation) largest = std::max(largest, std::abs(part));
  Affine result{Mat3d(1.0), translation};
  if (largest > 0.0) {
    double length = 0.0;
    for (const double part : rotation) length += (part / largest) * (part / largest);
    length = std::sqrt(length) * largest;
    const double x = rotation[0] / length, y = rotation[1] / length, z = rotation[2] / length,
                 w = rotation[3] / length;
    result.linear = Mat3d(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),   // image of x
                          2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),   // image of y
                          2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y));  // image of z
  }
  for (int axis = 0; axis < 3; ++axis) result.linear[axis] *= scale[axis];
  return result;
}

Affine affine_from_matrix(const double* m) {
  return {Mat3d(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]), Vec3d(m[12], m[13], m[14])};
}

bool is_finite(const Affine& affine) {
  return gridcast::is_finite(affine.translation) && gridcast::is_finite(affine.linear[0]) &&
         gridcast::is_finite(affine.linear[1]) && gridcast::is_finite(affine.linear[2]);
}

Affine rigid_part(const Affine& affine) {
  Affine result{Mat3d(1.0), affine.translation};
  const double back_length = glm::length(affine.linear[2]);
  if (!(back_length > 0.0) || !std::isfinite(back_length)) return result;
  const Vec3d back = affine.linear[2] / back_length;
  const Vec3d across = glm::cross(affine.linear[1], back);
  const double across_length = glm::length(across);
  if (!(across_length > 0.0) || !std::isfinite(across_length)) return result;
  const Vec3d right = across / across_length;
  result.linear = Mat3d(right, glm::cross(back, right), back);
  return result;
}

}  // namespace gridcast::io
