#include "core/math/trs.h"

#include <algorithm>
#include <cmath>

#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

namespace gridcast {

std::array<double, 4> normalized_rotation(const std::array<double, 4>& rotation) {
  // Scaled by the largest part first, so that huge and tiny quaternions keep their direction.
  double largest = 0.0;
  for (const double part : rotation) largest = std::max(largest, std::abs(part));
  if (!(largest > 0.0)) return {0.0, 0.0, 0.0, 1.0};
  double square = 0.0;
  for (const double part : rotation) square += (part / largest) * (part / largest);
  const double length = std::sqrt(square) * largest;
  std::array<double, 4> unit{};
  for (std::size_t i = 0; i < 4; ++i) unit[i] = rotation[i] / length;
  return unit;
}

Affine affine_from_trs(const Trs& trs) {
  const auto [x, y, z, w] = normalized_rotation(trs.rotation);
  Affine result;
  result.translation = trs.translation;
  result.linear = Mat3d(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),   // image of x
                        2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),   // image of y
                        2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y));  // image of z
  for (int axis = 0; axis < 3; ++axis) result.linear[axis] *= trs.scale[axis];
  return result;
}

Trs trs_from_affine(const Affine& affine) {
  Trs trs;
  trs.translation = affine.translation;
  Mat3d turned = affine.linear;
  for (int axis = 0; axis < 3; ++axis) {
    trs.scale[axis] = glm::length(turned[axis]);
    if (trs.scale[axis] > 0.0) turned[axis] /= trs.scale[axis];
  }
  if (glm::determinant(turned) < 0.0) {
    trs.scale.x = -trs.scale.x;
    turned[0] = -turned[0];
  }
  if (trs.scale.x * trs.scale.y * trs.scale.z == 0.0) return trs;
  const glm::dquat q = glm::quat_cast(turned);
  trs.rotation = normalized_rotation({q.x, q.y, q.z, q.w});
  return trs;
}

bool is_finite(const Affine& affine) {
  return is_finite(affine.translation) && is_finite(affine.linear[0]) && is_finite(affine.linear[1]) &&
         is_finite(affine.linear[2]);
}

}  // namespace gridcast
