// The body and the answer of POST .../explain.

#include <limits>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/explain_reply.h"
#include "proto/explain_request.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

using Json = nlohmann::ordered_json;

Parsed<ExplainRequest> parse(const std::string& body, const QueryParameters& query = {},
                             const Limits& limits = {}) {
  return parse_explain_request(body, query, limits);
}
std::string ray_with(const std::string& members) {
  return R"({"origin":[1,2,3],"direction":[0,0,-2])" + members + "}";
}

TEST(ExplainRequest, a_ray_alone_has_the_defaults) {
  const auto parsed = parse(ray_with(""));
  ASSERT_EQ(outcome(parsed), "ok");
  EXPECT_EQ(parsed->ray.origin, Vec3d(1, 2, 3));
  EXPECT_EQ(parsed->ray.direction, Vec3d(0, 0, -2));
  EXPECT_EQ(parsed->ray.tnear, 0.0);
  EXPECT_EQ(parsed->ray.tfar, std::numeric_limits<double>::infinity());
  EXPECT_EQ(parsed->excluded, PrimitiveRef{});
  EXPECT_EQ(parsed->precision, Precision::kRobust);
  EXPECT_EQ(parsed->max_steps, 10000U);
  EXPECT_FALSE(parsed->deadline_ms);
}

TEST(ExplainRequest, every_member_is_read) {
  const auto parsed = parse(ray_with(
      R"(,"tnear":-1.5,"tfar":7,"exclude":[4,5],"precision":"exact","max_steps":12,"deadline_ms":0.5)"));
  ASSERT_EQ(outcome(parsed), "ok");
  EXPECT_EQ(parsed->ray.tnear, -1.5);
  EXPECT_EQ(parsed->ray.tfar, 7.0);
  EXPECT_EQ(parsed->excluded, (PrimitiveRef{4, 5}));
  EXPECT_EQ(parsed->precision, Precision::kExact);
  EXPECT_EQ(parsed->max_steps, 12U);
  EXPECT_EQ(parsed->deadline_ms, 0.5);
  const auto nulls = parse(ray_with(R"(,"tnear":null,"tfar":null,"exclude":null)"));
  ASSERT_EQ(outcome(nulls), "ok");
  EXPECT_EQ(nulls->ray.tnear, 0.0);
  EXPECT_EQ(nulls->ray.tfar, std::numeric_limits<double>::infinity());
  EXPECT_EQ(nulls->excluded, PrimitiveRef{});
}

TEST(ExplainRequest, the_query_string_wins) {
  const QueryParameters query{{"precision", "fast"}, {"max_steps", "3"}, {"deadline_ms", "2"}};
  const auto parsed = parse(ray_with(R"(,"precision":"exact","max_steps":12,"deadline_ms":9)"), query);
  ASSERT_EQ(outcome(parsed), "ok");
  EXPECT_EQ(parsed->precision, Precision::kFast);
  EXPECT_EQ(parsed->max_steps, 3U);
  EXPECT_EQ(parsed->deadline_ms, 2.0);
}

TEST(ExplainRequest, a_small_limit_is_the_default_too) {
  Limits limits;
  limits.explain_steps = 50;
  EXPECT_EQ(parse(ray_with(""), {}, limits)->max_steps, 50U);
  EXPECT_EQ(outcome(parse(ray_with(R"(,"max_steps":51)"), {}, limits)), "out_of_range 422 /max_steps");
  EXPECT_EQ(outcome(parse(ray_with(""), {{"max_steps", "51"}}, limits)), "out_of_range 422 ?max_steps");
}

TEST(ExplainRequest, what_is_wrong_is_pointed_at) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "invalid_json 400 "},
      {"[]", "wrong_type 422 "},
      {"{}", "missing_field 422 /origin"},
      {R"({"origin":[0,0,0]})", "missing_field 422 /direction"},
      {R"({"direction":[0,0,1]})", "missing_field 422 /origin"},
      {R"({"origin":[[0,0,0]],"direction":[0,0,1]})", "wrong_type 422 /origin/0"},
      {R"({"origin":[0,0],"direction":[0,0,1]})", "wrong_length 422 /origin"},
      {R"({"origin":[0,0,0,0],"direction":[0,0,1]})", "wrong_length 422 /origin"},
      {R"({"origin":[0,"0",0],"direction":[0,0,1]})", "wrong_type 422 /origin/1"},
      {R"({"origin":[0,0,NaN],"direction":[0,0,1]})", "invalid_json 400 /origin/2"},
      {R"({"origin":null,"direction":[0,0,1]})", "wrong_type 422 /origin"},
      {R"({"origin":[0,0,2e30],"direction":[0,0,1]})", "out_of_range 422 /origin"},
      {R"({"origin":[0,0,0],"direction":[0,0,0]})", "out_of_range 422 /direction"},
      {R"({"origin":[0,0,0],"direction":[-0.0,0,0]})", "out_of_range 422 /direction"},
      {R"({"origin":[0,0,0],"direction":[0,0,1e-61]})", "out_of_range 422 /direction"},
      {R"({"origin":[0,0,0],"direction":[0,0,-1e61]})", "out_of_range 422 /direction"},
      {ray_with(R"(,"tnear":"0")"), "wrong_type 422 /tnear"},
      {ray_with(R"(,"tfar":[1])"), "wrong_type 422 /tfar"},
      {ray_with(R"(,"tfar":1,"tfar":2)"), "duplicate_field 400 /tfar"},
      {ray_with(R"(,"exclude":3)"), "wrong_type 422 /exclude"},
      {ray_with(R"(,"exclude":[1])"), "wrong_length 422 /exclude"},
      {ray_with(R"(,"exclude":[1,4294967295])"), "out_of_range 422 /exclude/1"},
      {ray_with(R"(,"precision":"exactly")"), "invalid_value 422 /precision"},
      {ray_with(R"(,"max_steps":0)"), "out_of_range 422 /max_steps"},
      {ray_with(R"(,"max_steps":-1)"), "out_of_range 422 /max_steps"},
      {ray_with(R"(,"max_steps":1.5)"), "wrong_type 422 /max_steps"},
      {ray_with(R"(,"max_steps":100001)"), "out_of_range 422 /max_steps"},
      {ray_with(R"(,"max_steps":1e30)"), "out_of_range 422 /max_steps"},
      {ray_with(R"(,"max_steps":null)"), "wrong_type 422 /max_steps"},
      {ray_with(R"(,"deadline_ms":0)"), "out_of_range 422 /deadline_ms"},
      {ray_with(R"(,"fields":["t"])"), "unknown_field 422 /fields"},
      {ray_with(R"(,"origins":[])"), "unknown_field 422 /origins"},
  };
  for (const auto& [body, expected] : cases) EXPECT_EQ(outcome(parse(body)), expected) << body;
  EXPECT_EQ(outcome(parse(ray_with(""), {{"stats", "true"}})), "unknown_parameter 422 ?stats");
  EXPECT_EQ(outcome(parse(ray_with(""), {{"max_steps", "x"}})), "out_of_range 422 ?max_steps");
  EXPECT_EQ(outcome(parse(ray_with(R"(,"tnear":5,"tfar":-5)"))), "ok") << "an empty range is no mistake";
}

TEST(ExplainReply, every_kind_of_step_is_written_with_its_members) {
  RayWay way(100, 9.0, {});
  way.add(CellStep{{1, 2, 3}, 0.5, 1.5, CellContent::kTree, 40, 7});
  way.add(BlockStep{{4, 5, 6}, 2.5, 3.5, 8, 9});
  way.add(CellNodeStep{1, 0.25, 8, 3, 2});
  way.add(InstanceStep{11, 12, InstanceOutcome::kEntered, 0.75, "wide_bvh"});
  way.add(InstanceStep{13, 14, InstanceOutcome::kOtherBlock, std::nullopt, {}});
  way.add(NodeStep{21, 2, 0.1, 8, 4, 3});
  way.add(LeafStep{22, 3, 0.2, 4, 5});
  way.add(TriangleStep{31, TriangleVerdict::kHit, true, 0.3});
  way.add(TriangleStep{32, TriangleVerdict::kFiltered, false, std::nullopt});
  way.add(OpaqueStep{"embree", true});
  SurfaceHit hit;
  hit.status = RayStatus::kHit;
  hit.t = 0.3;
  hit.u = 0.25;
  hit.v = 0.5;
  hit.normal = {0, 0, -1};
  hit.instance_id = 11;
  hit.mesh_id = 12;
  hit.primitive_id = 31;
  const std::string text = write_explain_json({7, hit, way.counts(), way.steps(), true});
  EXPECT_EQ(
      text,
      R"({"scene_version":"7","hit":{"t":0.3,"instance_id":11,"mesh_id":12,"primitive_id":31,"uv":[0.25,0.5],)"
      R"("normal":[0,0,-1]},"truncated":true,"counts":{"cells":1,"blocks":1,"skipped_blocks":16,"cell_nodes":1,)"
      R"("instances":1,"passed_instances":1,"nodes":1,"leaves":1,"triangles":1,"filtered_triangles":1,)"
      R"("max_stack":5},"steps":[)"
      R"({"kind":"cell","cell":[1,2,3],"t_enter":0.5,"t_exit":1.5,"content":"tree","instances":40,"skipped_blocks":7},)"
      R"({"kind":"block","block":[4,5,6],"t_enter":2.5,"t_exit":3.5,"instances":8,"skipped_blocks":9},)"
      R"({"kind":"cell_node","depth":1,"t_enter":0.25,"children":8,"children_hit":3,"stack":2},)"
      R"({"kind":"instance","instance_id":11,"mesh_id":12,"outcome":"entered","t_enter":0.75,"structure":"wide_bvh"},)"
      R"({"kind":"instance","instance_id":13,"mesh_id":14,"outcome":"other_block","t_enter":null},)"
      R"({"kind":"node","node":21,"depth":2,"t_enter":0.1,"children":8,"children_hit":4,"stack":3},)"
      R"({"kind":"leaf","leaf":22,"depth":3,"t_enter":0.2,"triangles":4,"stack":5},)"
      R"({"kind":"triangle","primitive_id":31,"verdict":"hit","t":0.3,"best":true},)"
      R"({"kind":"triangle","primitive_id":32,"verdict":"filtered","t":null,"best":false},)"
      R"({"kind":"opaque","structure":"embree","best":true}]})");
  EXPECT_TRUE(Json::accept(text));
}

TEST(ExplainReply, a_miss_is_null) {
  const RayWay way(1, 9.0, {});
  const Json json = Json::parse(write_explain_json({1, {}, way.counts(), way.steps(), false}));
  EXPECT_TRUE(json.at("hit").is_null());
  EXPECT_EQ(json.at("truncated"), false);
  EXPECT_TRUE(json.at("steps").empty());
}

}  // namespace
}  // namespace gridcast::proto
