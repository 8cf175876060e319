#pragma once

#include <cstdint>

#include "core/math/vec.h"

namespace gridcast::measure {

/// Smooth noise in about [-1, 1], cell size 1, its values at the lattice points hashed from `seed`.
[[nodiscard]] double noise(const Vec3d& p, std::uint64_t seed);

/// Octaves of noise, each of twice the frequency and `gain` times the height of the one before.
[[nodiscard]] double fractal_noise(const Vec3d& p, int octaves, double gain, std::uint64_t seed);

}  // namespace gridcast::measure
