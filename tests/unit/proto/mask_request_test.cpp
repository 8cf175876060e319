// Masks in requests: 1 to 255 of a query, 0 to 255 of an instance, in bodies and in query strings.

#include <gtest/gtest.h>

#include "proto/point_request.h"
#include "proto/ray_request.h"
#include "proto/render_request.h"
#include "proto/scene_request.h"
#include "proto/sensor_request.h"
#include "proto/visibility_request.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

struct Case {
  std::string body;
  std::string expected;
};

struct Asked {
  std::string outcome;
  InstanceMask mask = 0;
};

const std::string kJson = "application/json";

/// The mask of every kind of query, with `member` among its members and `query` as its parameters.
std::vector<Asked> ask_all(const std::string& member, const QueryParameters& query) {
  const Limits limits;
  std::vector<Asked> all;
  const auto add = [&](const auto& parsed, const auto& mask_of) {
    all.push_back({outcome(parsed), parsed.ok() ? mask_of(parsed.value()) : InstanceMask(0)});
  };
  const auto of_options = [](const auto& request) { return request.options.mask; };
  const auto own = [](const auto& request) { return request.mask; };
  const std::string rays = R"({"origins":[[0,0,5]],"directions":[[0,0,-1]])" + member + "}";
  for (const RayQuestion question :
       {RayQuestion::kClosest, RayQuestion::kAny, RayQuestion::kAll, RayQuestion::kCount})
    add(parse_ray_request(kJson, rays, query, limits, question), of_options);
  for (const PointQuestion question : {PointQuestion::kClosest, PointQuestion::kInside})
    add(parse_point_request(kJson, R"({"points":[[0,0,5]])" + member + "}", query, limits, question), own);
  const std::string pairs = R"({"from":[[0,0,5]],"to":[[0,0,-1]])" + member + "}";
  add(parse_visibility_request(kJson, pairs, query, limits), of_options);
  const std::string grid =
      R"({"type":"grid","pose":{"eye":[0,0,5],"target":[0,0,0]},"columns":2,"rows":2)" + member + "}";
  add(parse_sensor_request(grid, query, limits), of_options);
  if (query.empty()) add(parse_render_request(R"({"samples":1)" + member + "}", "*/*", limits), own);
  return all;
}

void expect_all(const std::string& member, const QueryParameters& query, const Asked& expected) {
  for (const Asked& asked : ask_all(member, query)) {
    EXPECT_EQ(asked.outcome, expected.outcome) << member;
    EXPECT_EQ(asked.mask, expected.mask) << member;
  }
}

TEST(MaskRequest, queries_of_every_kind_have_one) {
  EXPECT_EQ(ask_all("", {}).size(), 9U);
  expect_all("", {}, {"ok", kFullMask});
  expect_all(R"(,"mask":1)", {}, {"ok", 1});
  expect_all(R"(,"mask":254.0)", {}, {"ok", 254});
  expect_all(R"(,"mask":1)", {{"mask", "255"}}, {"ok", 255});
  expect_all("", {{"mask", "128"}}, {"ok", 128});
  const std::string row(24, '\0');
  const auto binary = parse_ray_request("application/vnd.gridcast.rays", row, {{"mask", "3"}}, Limits{});
  ASSERT_EQ(outcome(binary), "ok");
  EXPECT_EQ(binary.value().options.mask, 3U);
}

TEST(MaskRequest, a_query_that_sees_nothing_or_has_no_number_is_refused) {
  for (const char* wrong : {"0", "256", "-1", "1e300", "0.0"})
    expect_all(",\"mask\":" + std::string(wrong), {}, {"out_of_range 422 /mask", 0});
  for (const char* wrong : {"1.5", "\"1\"", "null", "[1]", "{}", "true"})
    expect_all(",\"mask\":" + std::string(wrong), {}, {"wrong_type 422 /mask", 0});
  for (const char* wrong : {"0", "256", "-1", "1.0", "+1", "", "0x1", "nan", "18446744073709551617"})
    expect_all("", {{"mask", wrong}}, {"out_of_range 422 ?mask", 0});
  expect_all(R"(,"mask":1,"mask":1)", {}, {"duplicate_field 400 /mask", 0});
  expect_all("", {{"mask", "1"}, {"mask", "1"}}, {"invalid_value 422 ?mask", 0});
}

TEST(MaskRequest, changes_of_instances_are_checked) {
  const Limits limits;
  const std::vector<Case> changes{
      {"{}", "missing_field 422 "},
      {R"({"mask":-1})", "out_of_range 422 /mask"},
      {R"({"mask":256})", "out_of_range 422 /mask"},
      {R"({"mask":1e300})", "out_of_range 422 /mask"},
      {R"({"mask":18446744073709551616})", "out_of_range 422 /mask"},
      {R"({"mask":1.5})", "wrong_type 422 /mask"},
      {R"({"mask":"255"})", "wrong_type 422 /mask"},
      {R"({"mask":null})", "wrong_type 422 /mask"},
      {R"({"mask":1,"mask":2})", "duplicate_field 400 /mask"},
      {R"({"masks":1})", "unknown_field 422 /masks"},
      {R"({"name":"a\u0000"})", "invalid_value 422 /name"},
      {R"({"mask":3,"transform":[]})", "wrong_length 422 /transform"},
      {R"({"mask":3})", "ok"},
  };
  for (const Case& c : changes)
    EXPECT_EQ(outcome(parse_change_instance(c.body, limits)), c.expected) << c.body;
}

}  // namespace
}  // namespace gridcast::proto
