#include "core/io/gltf_transform.h"

#include <algorithm>
#include <cmath>

namespace gridcast::io {
namespace {

/// A rotation but for the rounding of the code below, which would otherwise round it again.
bool is_rotation(const Mat3d& m) {
  constexpr double kRounding = 0x1p-48;
  double worst = 0.0;
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r <= c; ++r)
      worst = std::max(worst, std::abs(glm::dot(m[c], m[r]) - (c == r ? 1.0 : 0.0)));
  return worst <= kRounding && glm::determinant(m) > 0.0;
}

}  // namespace

Affine affine_from_matrix(const double* m) {
  return {Mat3d(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]), Vec3d(m[12], m[13], m[14])};
}

Affine rigid_part(const Affine& affine) {
  if (is_rotation(affine.linear)) return affine;
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
