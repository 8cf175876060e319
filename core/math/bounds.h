#pragma once

#include <limits>

#include "core/math/vec.h"

namespace gridcast {

/// A closed axis-aligned box. The default is empty: lower = +inf, upper = -inf, so that any extend() works.
template <class T>
struct Bounds {
  using Vec = glm::vec<3, T, glm::defaultp>;
  Vec lower{std::numeric_limits<T>::infinity()};
  Vec upper{-std::numeric_limits<T>::infinity()};

  void extend(const Vec& p) {
    lower = glm::min(lower, p);
    upper = glm::max(upper, p);
  }
  void extend(const Bounds& b) {
    lower = glm::min(lower, b.lower);
    upper = glm::max(upper, b.upper);
  }

  [[nodiscard]] bool empty() const {
    return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z);
  }
  [[nodiscard]] Vec extent() const { return upper - lower; }
  [[nodiscard]] Vec center() const { return T(0.5) * lower + T(0.5) * upper; }
  [[nodiscard]] bool contains(const Vec& p) const {
    return glm::all(glm::lessThanEqual(lower, p)) && glm::all(glm::lessThanEqual(p, upper));
  }
  [[nodiscard]] bool contains(const Bounds& b) const {
    return b.empty() || (contains(b.lower) && contains(b.upper));
  }
  [[nodiscard]] bool overlaps(const Bounds& b) const {
    return glm::all(glm::lessThanEqual(lower, b.upper)) && glm::all(glm::lessThanEqual(b.lower, upper));
  }
  /// Half the surface area: what the surface-area heuristic compares. 0 for an empty box.
  [[nodiscard]] T half_area() const {
    if (empty()) return T(0);
    const Vec e = extent();
    return e.x * e.y + e.y * e.z + e.z * e.x;
  }
  /// Largest absolute coordinate of any point in the box.
  [[nodiscard]] T magnitude() const { return std::max(max_abs(lower), max_abs(upper)); }

  friend bool operator==(const Bounds&, const Bounds&) = default;
};

using Bounds3f = Bounds<float>;
using Bounds3d = Bounds<double>;

inline Bounds3d to_double(const Bounds3f& b) {
  return {Vec3d(b.lower), Vec3d(b.upper)};
}

}  // namespace gridcast
