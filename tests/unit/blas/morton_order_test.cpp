#include "core/blas/morton_order.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include "tests/support/random.h"

namespace gridcast::blas {
namespace {

using test::Random;

BuildReference point(const Vec3d& p, std::size_t id) {
  Box4 box;
  box.extend(Float4{float(p.x), float(p.y), float(p.z), 0.F});
  return BuildReference::make(box, std::uint32_t(id));
}

MortonKeys order_of(const std::vector<BuildReference>& references) {
  return morton_order(references, bounds_of(references).centers);
}

/// Bit by bit, from cells found by division.
std::uint64_t naive_code(const BuildReference& reference, const Box4& centers) {
  const Float4 extent = centers.extent(), offset = doubled_center(reference.box()) - centers.lower;
  const double longest = std::max({double(extent[0]), double(extent[1]), double(extent[2])});
  std::uint64_t code = 0;
  for (int bit = 20; bit >= 0; --bit) {
    for (int axis = 0; axis < 3; ++axis) {
      const double share = longest > 0.0 ? double(offset[axis]) / longest : 0.0;
      const auto cell = std::min<std::uint64_t>(std::uint64_t(std::floor(share * 0x1p21)), 0x1fffff);
      code = code << 1 | (cell >> bit & 1);
    }
  }
  return code;
}

void expect_sorted(const std::vector<BuildReference>& references, const MortonKeys& keys) {
  ASSERT_EQ(keys.size(), references.size());
  std::vector<bool> seen(keys.size(), false);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    ASSERT_LT(keys[i].reference, seen.size());
    ASSERT_FALSE(seen[keys[i].reference]);
    seen[keys[i].reference] = true;
    if (i == 0) continue;
    ASSERT_TRUE(keys[i - 1].code < keys[i].code ||
                (keys[i - 1].code == keys[i].code && keys[i - 1].reference < keys[i].reference))
        << i;
  }
}

TEST(MortonOrder, codes_are_those_of_interleaved_cells) {
  Random random(test::seed_or(71));
  // A power of two across, so that division and multiplication by the inverse agree.
  std::vector<BuildReference> references{point(Vec3d(0.0), 0), point({4.0, 1.0, 2.0}, 1)};
  while (references.size() < 500)
    references.push_back(point({random.uniform(0.0, 4.0), random.uniform(), random.uniform()}, 0));
  const Box4 centers = bounds_of(references).centers;
  for (const MortonKey& key : order_of(references))
    EXPECT_EQ(key.code, naive_code(references[key.reference], centers)) << key.reference;
}

TEST(MortonOrder, keys_ascend_for_few_many_spread_and_crowded_centers) {
  Random random(test::seed_or(72));
  for (const std::size_t count : {1, 2, 100, 5000, 150000}) {
    for (const double crowd : {1.0, 1e-3, 1e-6, 0.0}) {
      SCOPED_TRACE(std::to_string(count) + " references, " + std::to_string(crowd));
      std::vector<BuildReference> references;
      // One far away: the others share the cells of a corner.
      for (std::size_t i = 0; i + 1 < count; ++i) references.push_back(point(random.in_box(crowd), i));
      references.push_back(point(Vec3d(-2.0), count));
      expect_sorted(references, order_of(references));
    }
  }
}

TEST(MortonOrder, sizes_from_denormals_to_the_largest_coordinates_are_told_apart) {
  for (const double size : {1e-44, 1e-38, 1e-20, 1.0, 1e18}) {
    SCOPED_TRACE(size);
    std::vector<BuildReference> references;
    for (int i = 7; i >= 0; --i) references.push_back(point(Vec3d(size * i / 7.0, 0.0, 0.0), 0));
    const MortonKeys keys = order_of(references);
    expect_sorted(references, keys);
    for (std::size_t i = 0; i < keys.size(); ++i) {
      EXPECT_EQ(keys[i].reference, 7 - i);
      EXPECT_EQ(keys[i].code >> 63, 0U);
    }
  }
}

TEST(MortonOrder, the_order_is_the_same_on_one_thread_and_on_many) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  Random random(test::seed_or(73));
  std::vector<BuildReference> references;
  for (std::size_t i = 0; i < 200000; ++i)
    references.push_back(point(random.in_box(i % 2 == 0 ? 1.0 : 1e-5), i));
  const auto on = [&](int count) {
    tbb::task_arena arena(count);
    return arena.execute([&] { return order_of(references); });
  };
  const MortonKeys one = on(1), many = on(4);
  ASSERT_EQ(one.size(), many.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(one[i].code, many[i].code);
    ASSERT_EQ(one[i].reference, many[i].reference);
  }
}

}  // namespace
}  // namespace gridcast::blas
