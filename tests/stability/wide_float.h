#pragma once
// 113 bits of significand: enough for products of a float and a double, and their comparison, without error.

#include "core/math/bounds.h"
#include "core/math/ray.h"

namespace gridcast::stability {

__extension__ typedef __float128 WideFloat;  // NOLINT(modernize-use-using): __extension__ needs it

/// Whether the ray, exactly as given, meets the closed box between tnear and tfar. Exact while the
/// differences of box and origin have no more than 60 bits, as those of floats of similar size have.
inline bool meets_exactly(const Ray& ray, const Bounds3d& box) {
  // t = numerator / denominator, denominator > 0.
  WideFloat enter = ray.tnear, enter_by = 1, exit = ray.tfar, exit_by = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const WideFloat d = ray.direction[axis], o = ray.origin[axis];
    if (d == 0) {
      if (o < WideFloat(box.lower[axis]) || o > WideFloat(box.upper[axis])) return false;
      continue;
    }
    const WideFloat size = d > 0 ? d : -d;
    const WideFloat near = d > 0 ? WideFloat(box.lower[axis]) - o : o - WideFloat(box.upper[axis]);
    const WideFloat far = d > 0 ? WideFloat(box.upper[axis]) - o : o - WideFloat(box.lower[axis]);
    if (near * enter_by > enter * size) {
      enter = near;
      enter_by = size;
    }
    if (far * exit_by < exit * size) {
      exit = far;
      exit_by = size;
    }
  }
  return enter * exit_by <= exit * enter_by;
}

}  // namespace gridcast::stability
