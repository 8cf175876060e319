#include "proto/tradeoff_request.h"

#include <gtest/gtest.h>

#include "proto/vocabulary.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

constexpr std::size_t kThreads = 4;

std::string said_of(const std::string& body, const Limits& limits = {}) {
  return outcome(parse_tradeoff_request(body, kThreads, limits));
}

TEST(TradeoffRequest, all_classes_and_precisions_are_measured_by_default) {
  const auto parsed = parse_tradeoff_request("{}", kThreads, Limits{});
  ASSERT_EQ(outcome(parsed), "ok");
  EXPECT_EQ(parsed->ray_classes, std::vector<std::string>(kRayClassNames.begin(), kRayClassNames.end()));
  EXPECT_EQ(parsed->precisions, (std::vector{Precision::kFast, Precision::kRobust, Precision::kExact}));
  EXPECT_TRUE(parsed->structures.empty());
  EXPECT_EQ(parsed->threads, 1U);
}

TEST(TradeoffRequest, members_are_read_in_the_order_given) {
  const auto parsed = parse_tradeoff_request(
      R"({"ray_classes":["edge","axis"],"structures":["kd_tree","bvh"],"precisions":["exact","fast"],)"
      R"("accuracy_rays":7,"speed_rays":8,"repeat":9,"threads":4,"seed":0,"deadline_ms":1.5})",
      kThreads, Limits{});
  ASSERT_EQ(outcome(parsed), "ok");
  EXPECT_EQ(parsed->ray_classes, (std::vector<std::string>{"edge", "axis"}));
  EXPECT_EQ(parsed->structures, (std::vector<std::string>{"kd_tree", "bvh"}));
  EXPECT_EQ(parsed->precisions, (std::vector{Precision::kExact, Precision::kFast}));
  EXPECT_EQ(parsed->accuracy_rays, 7U);
  EXPECT_EQ(parsed->speed_rays, 8U);
  EXPECT_EQ(parsed->repeat, 9U);
  EXPECT_EQ(parsed->threads, 4U);
  EXPECT_EQ(parsed->seed, 0U);
  EXPECT_EQ(parsed->deadline_ms, 1.5);
}

TEST(TradeoffRequest, what_is_wrong_is_pointed_at) {
  EXPECT_EQ(said_of("["), "invalid_json 400 /0");
  EXPECT_EQ(said_of("[]"), "wrong_type 422 ");
  EXPECT_EQ(said_of(R"({"ray_class":["edge"]})"), "unknown_field 422 /ray_class");
  EXPECT_EQ(said_of(R"({"ray_classes":"edge"})"), "wrong_type 422 /ray_classes");
  EXPECT_EQ(said_of(R"({"ray_classes":[]})"), "wrong_length 422 /ray_classes");
  EXPECT_EQ(said_of(R"({"ray_classes":["edge","corner"]})"), "invalid_value 422 /ray_classes/1");
  EXPECT_EQ(said_of(R"({"ray_classes":["edge","axis","edge"]})"), "duplicate_id 422 /ray_classes/2");
  EXPECT_EQ(said_of(R"({"structures":["auto"]})"), "invalid_value 422 /structures/0");
  EXPECT_EQ(said_of(R"({"precisions":["exact",1]})"), "wrong_type 422 /precisions/1");
  EXPECT_EQ(said_of(R"({"precisions":["default"]})"), "invalid_value 422 /precisions/0");
  for (const std::string count : {"accuracy_rays", "speed_rays", "repeat", "threads"})
    for (const std::string value : {"0", "-1", "1.5", "1e9"})
      EXPECT_EQ(said_of("{\"" + count + "\":" + value + "}").substr(0, 16),
                value == "1.5" ? "wrong_type 422 /" : "out_of_range 422")
          << count << " " << value;
  EXPECT_EQ(said_of(R"({"threads":5})"), "out_of_range 422 /threads");
  EXPECT_EQ(said_of(R"({"seed":9007199254740992})"), "out_of_range 422 /seed");
  EXPECT_EQ(said_of(R"({"deadline_ms":0})"), "out_of_range 422 /deadline_ms");
  EXPECT_EQ(said_of(R"({"deadline_ms":600001})"), "out_of_range 422 /deadline_ms");
}

TEST(TradeoffRequest, all_rays_together_are_bounded) {
  // 2 classes x (1 structure x 2 precisions + 2) x (10 + (3 + 1) x 5) = 240
  const std::string body =
      R"({"ray_classes":["edge","axis"],"structures":["bvh"],"precisions":["exact","fast"],)"
      R"("accuracy_rays":10,"speed_rays":5,"repeat":3})";
  Limits limits;
  limits.tradeoff_traces = 240;
  EXPECT_EQ(said_of(body, limits), "ok");
  limits.tradeoff_traces = 239;
  EXPECT_EQ(said_of(body, limits), "out_of_range 422 ");
}

}  // namespace
}  // namespace gridcast::proto
