// Parsers under random damage: whatever comes, an answer and no crash (run under sanitizers too).

#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/ray_request.h"
#include "proto/render_request.h"
#include "proto/scene_request.h"
#include "proto/transaction.h"
#include "proto/vertex_request.h"
#include "tests/support/random.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

/// One to four edits: bytes replaced, cut, repeated, or pieces of JSON put in.
std::string mutate(std::string text, test::Random& random) {
  static const std::vector<std::string> pieces{"[",   "]",      "{",        "}",   ",",
                                               ":",   "\"",     "null",     "-",   "1e999",
                                               "0.5", "\"\\u",  "\xC3\x28", "NaN", "18446744073709551616",
                                               "[[",  "{\"a\":"};
  const std::uint32_t edits = 1 + random.below(4);
  for (std::uint32_t e = 0; e < edits && !text.empty(); ++e) {
    const std::size_t at = random.below(std::uint32_t(text.size()));
    const std::size_t length = random.below(8);
    switch (random.below(4)) {
      case 0:
        text[at] = char(random.below(256));
        break;
      case 1:
        text.erase(at, length);
        break;
      case 2:
        text.insert(at, text.substr(at, length));
        break;
      default:
        text.insert(at, pieces[random.below(std::uint32_t(pieces.size()))]);
        break;
    }
  }
  return text;
}

/// Every refusal must be a well-formed problem with a status of the client's making.
template <class T>
bool is_sane(const Parsed<T>& parsed) {
  if (parsed.ok()) return true;
  const auto json = nlohmann::json::parse(to_json(parsed.problem()), nullptr, false);
  return !json.is_discarded() && parsed.problem().status() < 500 && !parsed.problem().detail.empty();
}

TEST(Mutation, damaged_json_is_answered) {
  test::Random random(test::seed_or(22));
  const Limits limits;
  const std::string rays =
      R"({"origins":[[0,0,5],[1,2,3e2]],"directions":[[0,0,-1],[0,1,0]],"tnear":[null,0],)"
      R"("tfar":[100,null],"exclude":[null,[2,11]],"fields":["uv"],"precision":"fast"})";
  const std::string moves =
      R"({"moves":[{"instance_id":3,"transform":[[1,0,0,0],[0,1,0,2],[0,0,1,0],[0,0,0,1]]}]})";
  const std::string render = R"({"camera":{"eye":[3,2,4],"target":[0,0,0],"yfov_deg":40},"width_px":800,)"
                             R"("layers":["depth"],"format":"exr","samples":4})";
  const std::string vertices = R"({"positions":[[0,1.5,0],[1,2,3]],"vertex_ids":[12,13],"update":"refit"})";
  const std::string transaction =
      R"({"edits":[{"op":"remove_instance","instance_id":1},{"op":"replace_vertices","mesh_id":0,)"
      R"("positions":[[0,1,2]],"vertex_ids":[3]},{"op":"add_instance","mesh_id":2,"name":"x"}]})";
  int refused = 0;
  for (int i = 0; i < 4000; ++i) {
    const std::string edits = mutate(transaction, random);
    ASSERT_TRUE(is_sane(parse_transaction(edits, limits))) << edits;
    const std::string body = mutate(rays, random);
    const auto parsed = parse_ray_request("application/json", body, {}, limits);
    refused += parsed.ok() ? 0 : 1;
    ASSERT_TRUE(is_sane(parsed)) << body;
    const std::string other = mutate(moves, random);
    ASSERT_TRUE(is_sane(parse_move_instances("application/json", other, limits))) << other;
    const std::string picture = mutate(render, random);
    ASSERT_TRUE(is_sane(parse_render_request(picture, "*/*", limits))) << picture;
    const std::string mesh = mutate(vertices, random);
    ASSERT_TRUE(is_sane(parse_vertex_request("application/json", mesh, {}, limits))) << mesh;
  }
  EXPECT_GT(refused, 2000) << "most damage must be noticed";
}

TEST(Mutation, damaged_binary_and_headers_are_answered) {
  test::Random random(test::seed_or(23));
  const std::string type = "application/vnd.gridcast.rays; dtype=float64; columns=8; exclude=ids";
  for (int i = 0; i < 4000; ++i) {
    std::string body(random.below(200), '\0');
    for (char& c : body) c = char(random.below(256));
    const auto rays = parse_ray_request(mutate(type, random), body, {}, Limits{});
    ASSERT_TRUE(is_sane(rays));
    if (rays.ok()) {
      const RayBatch batch = rays.value().batch();
      for (std::size_t k = 0; k < batch.size(); ++k) (void)is_valid(batch[k]);
    }
    const std::string dtype = i % 3 == 0 ? "; dtype=float32" : "";
    ASSERT_TRUE(is_sane(
        parse_move_instances(mutate("application/vnd.gridcast.instances" + dtype, random), body, Limits{})));
    ASSERT_TRUE(is_sane(parse_move_instances("application/vnd.gridcast.instances" + dtype, body, Limits{})));
    const std::string layout = i % 2 == 0 ? "; layout=sparse" : "";
    ASSERT_TRUE(
        is_sane(parse_vertex_request("application/vnd.gridcast.vertices" + layout, body, {}, Limits{})));
  }
}

}  // namespace
}  // namespace gridcast::proto
