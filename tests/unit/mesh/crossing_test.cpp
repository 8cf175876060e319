// Crossings of lines and triangles where rays meet edges, vertices and surfaces they start on.

#include "core/mesh/crossing.h"

#include <array>

#include <gtest/gtest.h>

#include "tests/support/moved_crossing.h"
#include "tests/support/random.h"

namespace gridcast::mesh {
namespace {

/// Integers, so that most lines meet something exactly.
Vec3d lattice_point(test::Random& random, std::uint32_t half) {
  const auto one = [&] { return double(random.below(2 * half + 1)) - double(half); };
  const double x = one(), y = one(), z = one();
  return {x, y, z};
}

struct Case {
  Vec3d origin, direction, p0, p1, p2;
};

Case lattice_case(test::Random& random) {
  Case one{lattice_point(random, 3), lattice_point(random, 2), lattice_point(random, 3),
           lattice_point(random, 3), lattice_point(random, 3)};
  if (one.direction == Vec3d(0.0)) one.direction.z = 1.0;
  return one;
}

TEST(Crossing, lines_and_origins_are_decided_as_if_the_origin_were_moved) {
  test::Random random(test::seed_or(61));
  std::array<std::size_t, 3> seen{};
  std::size_t on_plane = 0, on_edge_line = 0;
  for (int i = 0; i < 150'000; ++i) {
    const auto [o, d, p0, p1, p2] = lattice_case(random);
    const test::MovedCrossing expected = test::moved_crossing(o, d, p0, p1, p2);
    ASSERT_TRUE(expected.decided) << i;
    const int crossing = line_crossing(o, d, p0, p1, p2);
    ASSERT_EQ(crossing, expected.crossing) << i;
    ++seen[std::size_t(crossing + 1)];
    if (crossing == 0) continue;
    ASSERT_EQ(is_ahead(o, p0, p1, p2, crossing), expected.ahead) << i;
    on_plane += std::size_t(glm::dot(p0 - o, glm::cross(p1 - p0, p2 - p0)) == 0.0);
    on_edge_line += std::size_t(glm::dot(d, glm::cross(p0 - o, p1 - o)) == 0.0);
  }
  // What the test is about did come up.
  EXPECT_GT(std::min(seen[0], seen[2]), 1000U);
  EXPECT_GT(on_plane, 300U);
  EXPECT_GT(on_edge_line, 500U);
}

TEST(Crossing, far_from_the_origin_the_same_is_decided) {
  // Offsets that doubles hold and floats with these few bits do too.
  test::Random random(test::seed_or(62));
  for (int i = 0; i < 5000; ++i) {
    const auto [o, d, p0, p1, p2] = lattice_case(random);
    const Vec3d offset = 1048576.0 * lattice_point(random, 4);
    const int crossing = line_crossing(o + offset, d, p0 + offset, p1 + offset, p2 + offset);
    ASSERT_EQ(crossing, line_crossing(o, d, p0, p1, p2));
    if (crossing == 0) continue;
    ASSERT_EQ(is_ahead(o + offset, p0 + offset, p1 + offset, p2 + offset, crossing),
              is_ahead(o, p0, p1, p2, crossing));
  }
}

TEST(Crossing, the_other_winding_crosses_the_other_way) {
  test::Random random(test::seed_or(63));
  for (int i = 0; i < 5000; ++i) {
    const auto [o, d, p0, p1, p2] = lattice_case(random);
    const int crossing = line_crossing(o, d, p0, p1, p2);
    ASSERT_EQ(line_crossing(o, d, p0, p2, p1), -crossing);
    ASSERT_EQ(line_crossing(o, d, p1, p2, p0), crossing);
    ASSERT_EQ(line_crossing(o, -d, p0, p1, p2), -crossing);
    if (crossing == 0) continue;
    ASSERT_EQ(is_ahead(o, p0, p1, p2, crossing), is_ahead(o, p0, p2, p1, -crossing));
    ASSERT_NE(is_ahead(o, p0, p1, p2, crossing), is_ahead(o, p0, p1, p2, -crossing))
        << "a crossing is either ahead or behind";
  }
}

TEST(Crossing, points_on_a_triangle_are_those_of_which_fractions_say_so) {
  test::Random random(test::seed_or(64));
  std::size_t on = 0;
  for (int i = 0; i < 40'000; ++i) {
    const auto [o, d, p0, p1, p2] = lattice_case(random);
    const Vec3d normal = glm::cross(p1 - p0, p2 - p0);  // exact for such numbers
    const Vec3d areas{glm::dot(normal, glm::cross(p1 - o, p2 - o)),
                      glm::dot(normal, glm::cross(p2 - o, p0 - o)),
                      glm::dot(normal, glm::cross(p0 - o, p1 - o))};
    const bool expected = normal != Vec3d(0.0) && glm::dot(normal, p0 - o) == 0.0 &&
                          glm::all(glm::greaterThanEqual(areas, Vec3d(0.0)));
    ASSERT_EQ(lies_on(o, p0, p1, p2), expected) << i;
    on += std::size_t(expected);
  }
  EXPECT_GT(on, 100U);
}

}  // namespace
}  // namespace gridcast::mesh
