#include "core/measure/noise.h"

#include "core/measure/random.h"

namespace gridcast::measure {
namespace {

double lattice_value(std::int64_t x, std::int64_t y, std::int64_t z, std::uint64_t seed) {
  const std::uint64_t key =
      std::uint64_t(x) * 0x8DA6B343U ^ std::uint64_t(y) * 0xD8163841U ^ std::uint64_t(z) * 0xCB1AB31FU;
  return Random(key ^ (seed * 0x9E3779B97F4A7C15U)).uniform(-1.0, 1.0);
}

double fade(double t) {
  return t * t * t * (t * (6.0 * t - 15.0) + 10.0);
}

double mix(double a, double b, double t) {
  return a + (b - a) * t;
}

}  // namespace

double noise(const Vec3d& p, std::uint64_t seed) {
  const Vec3d cell = glm::floor(p);
  const Vec3d t{fade(p.x - cell.x), fade(p.y - cell.y), fade(p.z - cell.z)};
  const auto x = std::int64_t(cell.x), y = std::int64_t(cell.y), z = std::int64_t(cell.z);
  const auto along_x = [&](std::int64_t dy, std::int64_t dz) {
    return mix(lattice_value(x, y + dy, z + dz, seed), lattice_value(x + 1, y + dy, z + dz, seed), t.x);
  };
  return mix(mix(along_x(0, 0), along_x(1, 0), t.y), mix(along_x(0, 1), along_x(1, 1), t.y), t.z);
}

double fractal_noise(const Vec3d& p, int octaves, double gain, std::uint64_t seed) {
  double sum = 0.0, height = 1.0, frequency = 1.0;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += height * noise(frequency * p, seed + std::uint64_t(octave));
    height *= gain;
    frequency *= 2.0;
  }
  return sum;
}

}  // namespace gridcast::measure
