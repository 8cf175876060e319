#pragma once

#include <cmath>
#include <cstdint>

#include "core/math/vec.h"

namespace gridcast::measure {

/// The same numbers on every platform. "Fast Splittable Pseudorandom Number Generators", G. Steele, 2014.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t bits() {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return z ^ (z >> 31);
  }
  std::uint32_t below(std::uint32_t n) { return std::uint32_t(bits() % n); }
  double uniform() { return double(bits() >> 11) * 0x1p-53; }  ///< [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  Vec3d in_box(double half) { return {uniform(-half, half), uniform(-half, half), uniform(-half, half)}; }
  Vec3d direction() {
    for (;;) {
      const Vec3d v = in_box(1.0);
      const double length = glm::length(v);
      if (length > 0.01 && length <= 1.0) return v / length;
    }
  }
  /// Uniform over rotations: a unit quaternion as a matrix.
  Mat3d rotation() {
    const Vec3d axis = direction();
    // The angle's density is proportional to 1 - cos.
    double angle = uniform(0.0, 3.14159265358979323846);
    while (uniform() > 0.5 * (1.0 - std::cos(angle))) angle = uniform(0.0, 3.14159265358979323846);
    const double c = std::cos(angle), s = std::sin(angle);
    const auto column = [&](const Vec3d& v) {
      return c * v + s * glm::cross(axis, v) + (1.0 - c) * glm::dot(axis, v) * axis;
    };
    return {column({1, 0, 0}), column({0, 1, 0}), column({0, 0, 1})};
  }

 private:
  std::uint64_t state_;
};

}  // namespace gridcast::measure
