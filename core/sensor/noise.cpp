#include "core/sensor/noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace gridcast::sensor {
namespace {

constexpr std::uint64_t kStep = 0x9E3779B97F4A7C15ULL;

std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}

/// In (0, 1]: its logarithm is finite.
double unit(std::uint64_t bits) {
  return double((bits >> 11U) + 1) * 0x1p-53;
}

void disturb(const RangeNoise& noise, std::uint64_t ray, std::uint64_t echo, double& t) {
  t = std::max(0.0, t + noise.sigma_m * normal_sample(noise.seed, ray, echo));
}

}  // namespace

double normal_sample(std::uint64_t seed, std::uint64_t ray, std::uint64_t echo) {
  const std::uint64_t key = mix(mix(mix(seed + kStep) + ray + kStep) + echo + kStep);
  const double radius = std::sqrt(-2.0 * std::log(unit(mix(key + kStep))));
  return radius * std::cos(2.0 * std::numbers::pi * unit(mix(key + 2 * kStep)));
}

void add_noise(const RangeNoise& noise, HitColumns& hits) {
  for (std::size_t i = 0; i < hits.status.size(); ++i)
    if (hits.status[i] == RayStatus::kHit) disturb(noise, i, 0, hits.t[i]);
}

void add_noise(const RangeNoise& noise, HitLists& lists) {
  for (std::size_t i = 0; i < lists.status.size(); ++i)
    for (std::uint64_t row = lists.splits[i]; row < lists.splits[i + 1]; ++row)
      disturb(noise, i, row - lists.splits[i], lists.hits.t[row]);
}

}  // namespace gridcast::sensor
