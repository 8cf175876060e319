#include "core/blas/morton_order.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include "tests/support/random.h"

namespace gridcast::blas {
namespace {

using test::Random;

/// Doubled centers are points here.
Float4 point(const Vec3d& p) {
  return Float4{float(p.x), float(p.y), float(p.z), 0.F};
}

Box4 bounds_of(std::span<const Float4> centers) {
  Box4 bounds;
  for (const Float4 center : centers) bounds.extend(center);
  return bounds;
}

MortonKeys order_of(std::span<const Float4> centers) {
  return morton_order(centers, bounds_of(centers));
}

/// Bit by bit, from cells found by division.
std::uint64_t naive_code(Float4 center, const Box4& bounds, int bits) {
  const Float4 extent = bounds.extent(), offset = center - bounds.lower;
  const double longest = std::max({double(extent[0]), double(extent[1]), double(extent[2])});
  std::uint64_t code = 0;
  for (int bit = bits - 1; bit >= 0; --bit) {
    for (int axis = 0; axis < 3; ++axis) {
      const double share = longest > 0.0 ? double(offset[axis]) / longest : 0.0;
      const double cells = std::ldexp(1.0, bits);
      const auto cell = std::uint64_t(std::min(std::floor(share * cells), cells - 1.0));
      code = code << 1 | (cell >> bit & 1);
    }
  }
  return code;
}

/// Every number once, cells ascending, and within a cell numbers or, where it is crowded, finer cells.
void expect_sorted(std::span<const Float4> centers, const MortonKeys& keys) {
  ASSERT_EQ(keys.size(), centers.size());
  const Box4 bounds = bounds_of(centers);
  std::vector<bool> seen(keys.size(), false);
  for (const MortonKey key : keys) {
    ASSERT_LT(morton_number(key), seen.size());
    ASSERT_FALSE(seen[morton_number(key)]);
    seen[morton_number(key)] = true;
  }
  const auto fine = [&](std::size_t i) {
    return std::pair(naive_code(centers[morton_number(keys[i])], bounds, 21), morton_number(keys[i]));
  };
  for (std::size_t begin = 0, end = 0; begin < keys.size(); begin = end) {
    const std::uint64_t code = morton_code(keys[begin]);
    for (end = begin + 1; end < keys.size() && morton_code(keys[end]) == code;) ++end;
    if (end < keys.size()) {
      ASSERT_LT(code, morton_code(keys[end])) << end;
    }
    for (std::size_t i = begin + 1; i < end; ++i) {
      if (end - begin > kMaxUnorderedCell) {
        ASSERT_LT(fine(i - 1), fine(i)) << i;
      } else {
        ASSERT_LT(morton_number(keys[i - 1]), morton_number(keys[i])) << i;
      }
    }
  }
}

TEST(MortonOrder, codes_are_those_of_interleaved_cells) {
  Random random(test::seed_or(71));
  // A power of two across, so that division and multiplication by the inverse agree.
  std::vector<Float4> centers{point(Vec3d(0.0)), point({4.0, 1.0, 2.0})};
  while (centers.size() < 500)
    centers.push_back(point({random.uniform(0.0, 4.0), random.uniform(), random.uniform()}));
  const Box4 bounds = bounds_of(centers);
  for (const MortonKey key : order_of(centers))
    EXPECT_EQ(morton_code(key), naive_code(centers[morton_number(key)], bounds, kMortonAxisBits));
}

TEST(MortonOrder, keys_ascend_for_few_many_spread_and_crowded_centers) {
  Random random(test::seed_or(72));
  for (const std::size_t count : {1, 2, 100, 5000, 150000}) {
    for (const double crowd : {1.0, 0x1p-10, 0x1p-20, 0.0}) {
      SCOPED_TRACE(std::to_string(count) + " references, " + std::to_string(crowd));
      // Two corners, a power of two apart: the others share the cells in the middle.
      std::vector<Float4> centers{point(Vec3d(-2.0)), point(Vec3d(2.0))};
      while (centers.size() < count) centers.push_back(point(random.in_box(crowd)));
      centers.resize(count);
      expect_sorted(centers, order_of(centers));
    }
  }
}

TEST(MortonOrder, sizes_from_denormals_to_the_largest_coordinates_are_told_apart) {
  for (const double size : {1e-44, 1e-38, 1e-20, 1.0, 1e18}) {
    SCOPED_TRACE(size);
    std::vector<Float4> centers;
    for (int i = 7; i >= 0; --i) centers.push_back(point(Vec3d(size * i / 7.0, 0.0, 0.0)));
    const MortonKeys keys = order_of(centers);
    ASSERT_EQ(keys.size(), centers.size());
    for (std::size_t i = 0; i < keys.size(); ++i) EXPECT_EQ(morton_number(keys[i]), 7 - i);
  }
}

TEST(MortonOrder, the_order_is_the_same_on_one_thread_and_on_many) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  Random random(test::seed_or(73));
  std::vector<Float4> centers;
  for (std::size_t i = 0; i < 200000; ++i) centers.push_back(point(random.in_box(i % 2 == 0 ? 1.0 : 1e-5)));
  const auto on = [&](int count) {
    tbb::task_arena arena(count);
    return arena.execute([&] { return order_of(centers); });
  };
  EXPECT_EQ(on(1), on(4));
}

}  // namespace
}  // namespace gridcast::blas
