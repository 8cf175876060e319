#include "core/mesh/triangle_mesh.h"

#include <limits>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace gridcast::mesh {
namespace {

TEST(TriangleMesh, made_shapes_are_valid) {
  for (const TriangleMesh& mesh : {test::single_triangle(), test::box({0, 0, 0}, {1, 1, 1}),
                                   test::icosphere(2), test::torus(8, 5), TriangleMesh{}})
    EXPECT_TRUE(validate(mesh).ok());
}

TEST(TriangleMesh, a_position_that_is_not_finite_or_too_large_is_named) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1.1e18F}) {
    TriangleMesh mesh = test::box({0, 0, 0}, {1, 1, 1});
    mesh.positions[5].y = bad;
    const Status status = validate(mesh);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().where, "/positions/5");
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
  }
}

TEST(TriangleMesh, an_index_out_of_range_is_named) {
  TriangleMesh mesh = test::box({0, 0, 0}, {1, 1, 1});
  mesh.triangles[3][1] = 8;
  const Status status = validate(mesh);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().where, "/triangles/3");
}

TEST(TriangleMesh, normals_must_match_the_positions) {
  TriangleMesh mesh = test::single_triangle();
  mesh.normals.resize(2);
  ASSERT_FALSE(validate(mesh).ok());
  EXPECT_EQ(validate(mesh).error().where, "/normals");
}

TEST(TriangleMesh, parts_must_cover_the_triangles_in_order) {
  TriangleMesh mesh = test::box({0, 0, 0}, {1, 1, 1});
  mesh.parts = {{0, 5, 0}, {5, 7, 1}};
  EXPECT_TRUE(validate(mesh).ok());
  mesh.parts[1].triangle_count = 6;
  EXPECT_EQ(validate(mesh).error().where, "/parts");
  mesh.parts[1] = {6, 6, 1};
  EXPECT_EQ(validate(mesh).error().where, "/parts/1");
}

TEST(TriangleMesh, part_of_finds_the_part_and_skips_empty_ones) {
  TriangleMesh mesh = test::box({0, 0, 0}, {1, 1, 1});
  EXPECT_EQ(mesh.part_of(7), 0U);
  mesh.parts = {{0, 5, 0}, {5, 0, 1}, {5, 7, 2}};
  EXPECT_EQ(mesh.part_of(0), 0U);
  EXPECT_EQ(mesh.part_of(4), 0U);
  EXPECT_EQ(mesh.part_of(5), 2U);
  EXPECT_EQ(mesh.part_of(11), 2U);
}

TEST(TriangleMesh, bounds_ignore_vertices_no_triangle_uses) {
  TriangleMesh mesh = test::single_triangle();
  mesh.positions.push_back({100, 100, 100});
  EXPECT_EQ(mesh.bounds(), (Bounds3f{{0, 0, 0}, {1, 1, 0}}));
  EXPECT_TRUE(TriangleMesh{}.bounds().empty());
}

}  // namespace
}  // namespace gridcast::mesh
