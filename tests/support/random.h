#pragma once
// Seeds are printed with every random test and can be overridden: GRIDCAST_SEED=123 ctest ...

#include <cstdint>
#include <random>

#include "core/math/vec.h"

namespace gridcast::test {

/// `fixed` unless the environment variable GRIDCAST_SEED is set; printed as a GoogleTest property and on
/// stdout.
std::uint64_t seed_or(std::uint64_t fixed);

/// The same numbers on every platform: std::mt19937_64 with our own mapping to doubles.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  std::uint64_t bits() { return engine_(); }
  std::uint32_t below(std::uint32_t n) { return std::uint32_t(engine_() % n); }
  double uniform() { return double(engine_() >> 11) * 0x1p-53; }  ///< [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  Vec3d in_box(double half) { return {uniform(-half, half), uniform(-half, half), uniform(-half, half)}; }
  Vec3d direction();  ///< uniform on the unit sphere

 private:
  std::mt19937_64 engine_;
};

}  // namespace gridcast::test
