#include "tests/support/random.h"

#include <cstdlib>
#include <iostream>
#include <string>

#include <gtest/gtest.h>

namespace gridcast::test {

std::uint64_t seed_or(std::uint64_t fixed) {
  const char* text = std::getenv("GRIDCAST_SEED");
  const std::uint64_t seed = text != nullptr ? std::strtoull(text, nullptr, 0) : fixed;
  std::cout << "seed " << seed << " (GRIDCAST_SEED overrides)\n";
  testing::Test::RecordProperty("seed", std::to_string(seed));
  return seed;
}

Vec3d Random::direction() {
  for (;;) {
    const Vec3d v = in_box(1.0);
    const double length = glm::length(v);
    if (length > 0.01 && length <= 1.0) return v / length;
  }
}

}  // namespace gridcast::test
