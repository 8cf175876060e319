#include "core/scene/raster.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace gridcast::scene {
namespace {

constexpr double kDiagonal = 10.0;

/// Rays in lines of `width`, of which the first `missing` and all after `count` are left out.
class Lines {
 public:
  template <class MakeRay>
  Lines(std::size_t width, std::size_t missing, std::size_t count, const MakeRay& make_ray) {
    for (std::size_t i = missing; i < missing + count; ++i) {
      const Ray ray = make_ray(double(i % width), double(i / width));
      for (const Vec3d& v : {ray.origin, ray.direction})
        for (int axis = 0; axis < 3; ++axis) rows_.push_back(v[axis]);
    }
  }
  [[nodiscard]] RayBatch batch() const {
    return {std::as_bytes(std::span(rows_)), ScalarType::kFloat64, 6, {}};
  }
  double* row(std::size_t i) { return &rows_[6 * i]; }

 private:
  std::vector<double> rows_;
};

Ray pinhole(double x, double y) {
  return {{0, 0, 5}, {0.003 * x - 0.2, 0.2 - 0.003 * y, -1.0}};
}
Ray orthographic(double x, double y) {
  return {{0.02 * x, 0.02 * y, 5}, {0, 0, -1.0}};
}

void expect_raster(const Lines& lines, std::size_t width, std::size_t missing) {
  const auto raster = find_raster(lines.batch(), kDiagonal);
  ASSERT_TRUE(raster.has_value());
  EXPECT_EQ(raster->width, width);
  EXPECT_EQ(raster->missing, missing);
}

TEST(Raster, is_found_in_the_rays_of_a_camera) {
  for (const std::size_t width : {16U, 101U, 640U}) {
    SCOPED_TRACE(width);
    expect_raster({width, 0, 50 * width, pinhole}, width, 0);
    expect_raster({width, 0, 50 * width + 3, pinhole}, width, 0);
    expect_raster({width, 0, 50 * width, orthographic}, width, 0);
  }
}

TEST(Raster, is_found_from_the_middle_of_a_line_on) {
  expect_raster({100, 63, 5000, pinhole}, 100, 63);
  expect_raster({100, 90, 5000, orthographic}, 100, 90);
}

TEST(Raster, is_not_seen_where_there_is_none) {
  const auto found = [](const Lines& lines) { return find_raster(lines.batch(), kDiagonal).has_value(); };
  EXPECT_FALSE(found({100000, 0, 50000, pinhole})) << "one line";
  EXPECT_FALSE(found({100, 0, 390, pinhole})) << "too few lines";
  EXPECT_FALSE(found({10, 0, 5000, pinhole})) << "too narrow";
  EXPECT_FALSE(found({100, 0, 0, pinhole}));
  EXPECT_FALSE(found({100, 0, 1, pinhole}));
  const auto rings = [](double x, double y) { return pinhole(x, 20.0 * y); };
  EXPECT_FALSE(found({100, 0, 5000, rings})) << "lines far apart, as of a lidar";
  const auto same = [](double /*x*/, double /*y*/) { return pinhole(0, 0); };
  EXPECT_FALSE(found({100, 0, 5000, same})) << "one ray again and again";
  test::Random random(test::seed_or(71));
  const auto any = [&](double /*x*/, double /*y*/) { return Ray{random.in_box(1.0), random.direction()}; };
  EXPECT_FALSE(found({100, 0, 5000, any})) << "strangers";
}

TEST(Raster, is_not_seen_where_a_ray_is_none_or_lines_change) {
  Lines lines(100, 0, 5000, pinhole);
  lines.row(30)[3] = std::nan("");
  EXPECT_FALSE(find_raster(lines.batch(), kDiagonal).has_value());
  // Of another width from the middle on.
  const auto changes = [](double x, double y) {
    const double i = 100.0 * y + x;
    return y < 25.0 ? pinhole(x, y) : pinhole(std::fmod(i, 130.0), std::floor(i / 130.0));
  };
  EXPECT_FALSE(find_raster(Lines(100, 0, 5000, changes).batch(), kDiagonal).has_value());
}

TEST(Raster, tiles_name_every_ray_once) {
  for (const auto& [width, missing, count] : {std::array<std::size_t, 3>{8, 0, 64},
                                              {8, 3, 64},
                                              {101, 0, 3000},
                                              {101, 100, 3001},
                                              {9, 5, 50},
                                              {640, 1, 2601}}) {
    const std::vector<std::uint32_t> order = order_by_tiles({width, missing}, count);
    std::vector<std::uint32_t> sorted = order, all(count);
    std::sort(sorted.begin(), sorted.end());
    std::iota(all.begin(), all.end(), 0U);
    EXPECT_EQ(sorted, all) << width << ' ' << missing << ' ' << count;
  }
}

TEST(Raster, sixteen_that_follow_each_other_are_a_square) {
  const std::vector<std::uint32_t> order = order_by_tiles({12, 0}, 48);
  const std::vector<std::uint32_t> first(order.begin(), order.begin() + 16);
  EXPECT_EQ(first, (std::vector<std::uint32_t>{0, 1, 2, 3, 12, 13, 14, 15, 24, 25, 26, 27, 36, 37, 38, 39}));
}

}  // namespace
}  // namespace gridcast::scene
