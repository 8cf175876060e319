#include "proto/vertex_reply.h"

#include <bit>
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "proto/vertex_request.h"
#include "tests/support/random.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

std::vector<Vec3f> any_floats(std::size_t count) {
  test::Random random(test::seed_or(27));
  std::vector<Vec3f> positions;
  while (positions.size() < count) {
    Vec3f position;
    for (int c = 0; c < 3; ++c) position[c] = std::bit_cast<float>(std::uint32_t(random.bits()));
    if (is_finite(position)) positions.push_back(position);
  }
  positions.push_back({-0.F, 0.F, 1e-45F});
  return positions;
}

TEST(VertexReply, both_forms_are_read_back_bit_for_bit) {
  const std::vector<Vec3f> positions = any_floats(3000);
  const std::string text = write_vertices_json(positions, 1 << 20).value();
  const std::string bytes = write_vertices_binary(positions);
  for (const auto& read : {parse_vertex_request("application/json", text, {}, Limits{}),
                           parse_vertex_request("application/vnd.gridcast.vertices", bytes, {}, Limits{})}) {
    ASSERT_EQ(outcome(read), "ok");
    ASSERT_EQ(read.value().positions.size(), positions.size());
    EXPECT_EQ(std::memcmp(read.value().positions.data(), positions.data(), bytes.size()), 0);
    EXPECT_TRUE(read.value().vertex_ids.empty());
  }
}

TEST(VertexReply, json_stops_at_its_limit) {
  const std::vector<Vec3f> positions{{0.5F, -1, 2}, {3, 4, 5}};
  const std::string text = R"({"positions":[[0.5,-1,2],[3,4,5]]})";
  EXPECT_EQ(write_vertices_json(positions, text.size()), text);
  EXPECT_EQ(write_vertices_json(positions, text.size() - 1), std::nullopt);
  EXPECT_EQ(write_vertices_json(any_floats(5000), 100), std::nullopt);
  EXPECT_EQ(write_vertices_json({}, 100), R"({"positions":[]})");
  EXPECT_EQ(write_vertices_binary({}), "");
}

}  // namespace
}  // namespace gridcast::proto
