#include "core/render/sampling.h"

#include <cmath>

namespace gridcast::render {
namespace {

// "splitmix64", "Fast Splittable Pseudorandom Number Generators", G. L. Steele, 2014: its output function.
std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27U)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31U);
}

double unit(std::uint32_t bits) {
  return double(bits) * 0x1p-32;
}

std::uint32_t reversed_bits(std::uint32_t x) {
  x = (x >> 16U) | (x << 16U);
  x = ((x & 0x00FF00FFU) << 8U) | ((x & 0xFF00FF00U) >> 8U);
  x = ((x & 0x0F0F0F0FU) << 4U) | ((x & 0xF0F0F0F0U) >> 4U);
  x = ((x & 0x33333333U) << 2U) | ((x & 0xCCCCCCCCU) >> 2U);
  return ((x & 0x55555555U) << 1U) | ((x & 0xAAAAAAAAU) >> 1U);
}

}  // namespace

glm::dvec2 pixel_sample(std::uint32_t x_px, std::uint32_t y_px, std::uint32_t index, std::uint32_t count) {
  if (count <= 1) return {0.5, 0.5};
  const std::uint64_t shift = mix((std::uint64_t(y_px) << 32U | x_px) + 0x9E3779B97F4A7C15ULL);
  const double x = (double(index) + unit(std::uint32_t(shift))) / double(count);
  const double y = unit(reversed_bits(index)) + unit(std::uint32_t(shift >> 32U));
  return {x, y - std::floor(y)};
}

}  // namespace gridcast::render
