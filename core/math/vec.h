#pragma once
// The vector types of the engine. World space is double, object space is float (see core/README.md).

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

namespace gridcast {

using Vec3d = glm::dvec3;
using Vec3f = glm::vec3;
using Mat3d = glm::dmat3;

/// No instance, mesh, primitive or material: all bits set, on the wire as in memory.
inline constexpr std::uint32_t kInvalidId = 0xFFFFFFFFU;

inline bool is_finite(const Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
inline bool is_finite(const Vec3f& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Largest absolute component: the infinity norm.
inline double max_abs(const Vec3d& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}
inline float max_abs(const Vec3f& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// v[axis] for an axis that is not known when compiling: an address, where glm's operator[] is a switch.
template <class T>
inline T component(const glm::vec<3, T, glm::defaultp>& v, int axis) {
  return glm::value_ptr(v)[axis];
}

}  // namespace gridcast
