#pragma once
// What a sensor measures wrongly, the same at every time and in every order.

#include <cstdint>

#include "core/math/hit_lists.h"

namespace gridcast::sensor {

/// Gaussian noise of measured distances.
struct RangeNoise {
  double sigma_m = 0.0;
  std::uint64_t seed = 0;
};

/// A sample of the normal distribution, mean 0 and variance 1, as a function of its arguments alone: two
/// hashes of them ("Fast Splittable Pseudorandom Number Generators", G. L. Steele, 2014: its output function)
/// as uniform numbers, by the formula of "A Note on the Generation of Random Normal Deviates", G. E. P. Box,
/// 1958.
[[nodiscard]] double normal_sample(std::uint64_t seed, std::uint64_t ray, std::uint64_t echo);

/// Adds noise to every t: the first and only echo of ray i, or that of its number in the list of the ray.
/// What falls below 0 is 0. Lists keep their order, which is that of the true distances.
void add_noise(const RangeNoise& noise, HitColumns& hits);
void add_noise(const RangeNoise& noise, HitLists& lists);

}  // namespace gridcast::sensor
