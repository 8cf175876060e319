#include "proto/ray_request.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

const std::string kBinary = "application/vnd.gridcast.rays";

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

TEST(RayRequest, json_columns_become_rows_with_their_defaults) {
  const auto request = parse_ray_request(
      "application/json; charset=utf-8",
      R"({"origins":[[1,2,3],[4,5,6]],"directions":[[0,0,-1],[0,0,0]],"tnear":[null,-0.5],"tfar":[100,null],)"
      R"("exclude":[null,[2,11]],"precision":"fast","fields":["uv","t"],"stats":true,"deadline_ms":12.5})",
      {}, Limits{});
  ASSERT_EQ(outcome(request), "ok");
  const RayBatch batch = request.value().batch();
  ASSERT_EQ(batch.size(), 2U);
  EXPECT_EQ(batch[0].origin, Vec3d(1, 2, 3));
  EXPECT_EQ(batch[0].tnear, 0.0);
  EXPECT_EQ(batch[0].tfar, 100.0);
  EXPECT_EQ(batch[1].tnear, -0.5);
  EXPECT_EQ(batch[1].tfar, std::numeric_limits<double>::infinity());
  EXPECT_FALSE(is_valid(batch[1])) << "a zero direction is not a request error";
  EXPECT_EQ(batch.excluded[0], PrimitiveRef());
  EXPECT_EQ(batch.excluded[1], (PrimitiveRef{2, 11}));
  const RayOptions& options = request.value().options;
  EXPECT_EQ(options.precision, Precision::kFast);
  EXPECT_EQ(options.fields, HitField::kUv);
  EXPECT_EQ(options.stats, StatsMode::kOn);
  EXPECT_EQ(options.deadline_ms, 12.5);
}

TEST(RayRequest, no_rays_are_a_valid_request) {
  const auto json = parse_ray_request("application/json", R"({"origins":[],"directions":[]})", {}, Limits{});
  ASSERT_EQ(outcome(json), "ok");
  EXPECT_EQ(json.value().batch().size(), 0U);
  const auto binary = parse_ray_request(kBinary, "", {}, Limits{});
  ASSERT_EQ(outcome(binary), "ok");
  EXPECT_EQ(binary.value().batch().size(), 0U);
}

TEST(RayRequest, the_query_string_wins_over_the_body) {
  const std::string body = R"({"origins":[],"directions":[],"precision":"fast","fields":["uv"]})";
  const auto request = parse_ray_request("application/json", body,
                                         {{"precision", "exact"}, {"fields", "normal,mesh_id"}}, Limits{});
  ASSERT_EQ(outcome(request), "ok");
  EXPECT_EQ(request.value().options.precision, Precision::kExact);
  EXPECT_EQ(request.value().options.fields, HitField::kNormal | HitField::kMeshId);
}

TEST(RayRequest, query_parameters_are_strict) {
  const auto parse = [](const QueryParameters& query) {
    return outcome(parse_ray_request(kBinary, "", query, Limits{}));
  };
  EXPECT_EQ(parse({{"masks", "1"}}), "unknown_parameter 422 ?masks");
  EXPECT_EQ(parse({{"precision", ""}}), "invalid_value 422 ?precision");
  EXPECT_EQ(parse({{"precision", "fast"}, {"precision", "fast"}}), "invalid_value 422 ?precision");
  EXPECT_EQ(parse({{"fields", "uv,"}}), "ok");
  EXPECT_EQ(parse({{"fields", "uv,,normal"}}), "invalid_value 422 ?fields");
  EXPECT_EQ(parse({{"stats", "yes"}}), "invalid_value 422 ?stats");
  EXPECT_EQ(parse({{"deadline_ms", "nan"}}), "out_of_range 422 ?deadline_ms");
  EXPECT_EQ(parse({{"deadline_ms", "1e999"}}), "out_of_range 422 ?deadline_ms");
  EXPECT_EQ(parse({{"deadline_ms", "10ms"}}), "out_of_range 422 ?deadline_ms");
  EXPECT_EQ(parse({{"deadline_ms", "10"}}), "ok");
}

TEST(RayRequest, binary_rows_are_read_where_they_lie) {
  const std::vector<float> narrow{1, 2, 3, 0, 0, -1};
  const std::string body = bytes_of(narrow);
  const auto request = parse_ray_request(kBinary, body, {}, Limits{});
  ASSERT_EQ(outcome(request), "ok");
  const RayBatch batch = request.value().batch();
  EXPECT_EQ(static_cast<const void*>(batch.bytes.data()), static_cast<const void*>(body.data()));
  EXPECT_EQ(batch.size(), 1U);
  EXPECT_EQ(batch[0].direction, Vec3d(0, 0, -1));

  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string wide = bytes_of(std::vector<double>{nan, 2, 3, 0.25, 0, 0, -1, 9});
  const auto eight = parse_ray_request(kBinary + "; dtype=float64; columns=\"8\"", wide, {}, Limits{});
  ASSERT_EQ(outcome(eight), "ok");
  EXPECT_EQ(eight.value().batch()[0].tnear, 0.25);
  EXPECT_EQ(eight.value().batch()[0].tfar, 9.0);
  EXPECT_FALSE(is_valid(eight.value().batch()[0]));
}

TEST(RayRequest, excluded_ids_come_before_binary_rows) {
  const std::vector<float> rows{1, 2, 3, 0, 0, -1, 4, 5, 6, 0, 1, 0};
  const std::string body =
      bytes_of(std::vector<std::uint32_t>{2, 11, kInvalidId, kInvalidId}) + bytes_of(rows);
  const auto request = parse_ray_request(kBinary + "; exclude=ids", body, {}, Limits{});
  ASSERT_EQ(outcome(request), "ok");
  const RayBatch batch = request.value().batch();
  ASSERT_EQ(batch.size(), 2U);
  EXPECT_EQ(static_cast<const void*>(batch.bytes.data()), static_cast<const void*>(body.data() + 16));
  EXPECT_EQ(batch[1].origin, Vec3d(4, 5, 6));
  ASSERT_EQ(batch.excluded.size(), 2U);
  EXPECT_EQ(batch.excluded[0], (PrimitiveRef{2, 11}));
  EXPECT_EQ(batch.excluded[1], PrimitiveRef());
  EXPECT_TRUE(parse_ray_request(kBinary + "; exclude=none", "", {}, Limits{}).value().excluded.empty());

  const std::string half = bytes_of(std::vector<std::uint32_t>{2, 11, 3, kInvalidId}) + bytes_of(rows);
  EXPECT_EQ(outcome(parse_ray_request(kBinary + "; exclude=ids", half, {}, Limits{})),
            "out_of_range 422 /exclude/1");
  for (std::size_t n = 0; n <= body.size(); ++n) {
    const auto cut = parse_ray_request(kBinary + "; exclude=ids", body.substr(0, n), {}, Limits{});
    EXPECT_EQ(cut.ok(), n % 32 == 0) << n;
  }
}

TEST(RayRequest, every_truncation_of_a_binary_ray_is_refused) {
  const std::string body = bytes_of(std::vector<float>(12, 1.F));
  for (std::size_t n = 0; n <= body.size(); ++n) {
    const std::string expected = n % 24 == 0 ? "ok" : "wrong_length 422 ";
    EXPECT_EQ(outcome(parse_ray_request(kBinary, body.substr(0, n), {}, Limits{})), expected) << n;
  }
}

TEST(RayRequest, media_types_and_their_parameters_are_a_closed_list) {
  const auto parse = [](const std::string& type) {
    return outcome(parse_ray_request(type, "", {}, Limits{}));
  };
  const std::string refused = "unsupported_media_type 415 Content-Type";
  for (const std::string type :
       {"", "text/plain", "application", "application/json, text/plain",
        "application/vnd.gridcast.rays; dtype=int8",
        "application/vnd.gridcast.rays; dtype=float32; dtype=float64",
        "application/vnd.gridcast.rays; columns=7", "application/vnd.gridcast.rays; exclude=yes",
        "application/vnd.gridcast.rays; rows=8", "application/vnd.gridcast.rays;"})
    EXPECT_EQ(parse(type), refused) << type;
  EXPECT_EQ(parse("Application/Vnd.Gridcast.Rays ; DType=float32"), "ok");
}

TEST(RayRequest, limits_hold_at_one_below_at_and_one_above) {
  Limits limits;
  limits.json_rays = 3;
  limits.binary_rays = 3;
  for (std::size_t n = 2; n <= 4; ++n) {
    std::string column;
    for (std::size_t i = 0; i < n; ++i) column += std::string(i == 0 ? "" : ",") + "[0,0,1]";
    const std::string body = "{\"origins\":[" + column + "],\"directions\":[" + column + "]}";
    EXPECT_EQ(outcome(parse_ray_request("application/json", body, {}, limits)),
              n <= 3 ? "ok" : "too_many_rays 413 /origins");
    EXPECT_EQ(outcome(parse_ray_request(kBinary, std::string(24 * n, '\0'), {}, limits)),
              n <= 3 ? "ok" : "too_many_rays 413 ");
    EXPECT_EQ(outcome(parse_ray_request(kBinary + "; exclude=ids", std::string(32 * n, '\0'), {}, limits)),
              n <= 3 ? "ok" : "too_many_rays 413 ");
  }
  const std::string body = R"({"origins":[],"directions":[]})";
  for (int extra = -1; extra <= 1; ++extra) {
    limits.json_bytes = std::size_t(int(body.size()) + extra);
    EXPECT_EQ(outcome(parse_ray_request("application/json", body, {}, limits)),
              extra >= 0 ? "ok" : "payload_too_large 413 ");
    limits.binary_bytes = std::size_t(48 + extra);
    EXPECT_EQ(outcome(parse_ray_request(kBinary, std::string(48, '\0'), {}, limits)),
              extra >= 0 ? "ok" : "payload_too_large 413 ");
  }
}

TEST(RayRequest, doubles_survive_json_bit_for_bit) {
  test::Random random(test::seed_or(20));
  std::vector<double> values;
  while (values.size() < 3000) {
    const double value = std::bit_cast<double>(random.bits());
    if (std::isfinite(value)) values.push_back(value);
  }
  std::string column;
  char text[64];
  for (std::size_t i = 0; i < values.size(); i += 3) {
    std::snprintf(text, sizeof text, "%s[%.17g,", i == 0 ? "" : ",", values[i]);
    column += text;
    std::snprintf(text, sizeof text, "%.17g,", values[i + 1]);
    column += text;
    std::snprintf(text, sizeof text, "%.17g]", values[i + 2]);
    column += text;
  }
  const auto request = parse_ray_request(
      "application/json", "{\"origins\":[" + column + "],\"directions\":[" + column + "]}", {}, Limits{});
  ASSERT_EQ(outcome(request), "ok");
  const RayBatch batch = request.value().batch();
  for (std::size_t i = 0; i < batch.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const auto want = std::bit_cast<std::uint64_t>(values[3 * i + std::size_t(c)]);
      ASSERT_EQ(std::bit_cast<std::uint64_t>(batch[i].origin[c]), want);
      ASSERT_EQ(std::bit_cast<std::uint64_t>(batch[i].direction[c]), want);
    }
  }
}

TEST(AnnouncedRays, are_known_but_for_the_rays_when_nothing_is_wrong) {
  const auto announced = [](const std::string& type, std::size_t bytes, const QueryParameters& query = {},
                            RayQuestion question = RayQuestion::kClosest) {
    return announced_rays(type, bytes, query, Limits{}, question);
  };
  const auto rays = announced(kBinary + "; dtype=float64; columns=8", 640, {{"precision", "fast"}});
  ASSERT_TRUE(rays);
  EXPECT_EQ(rays->scalar, ScalarType::kFloat64);
  EXPECT_EQ(rays->columns, 8U);
  EXPECT_EQ(rays->options.precision, Precision::kFast);
  EXPECT_TRUE(announced(kBinary + "; exclude=none", 24));
  EXPECT_FALSE(announced("application/json", 640));
  EXPECT_FALSE(announced(kBinary + "; exclude=ids", 32)) << "ids come before the rows";
  EXPECT_FALSE(announced(kBinary, 25)) << "no whole rows";
  EXPECT_FALSE(announced(kBinary + "; dtype=half", 24));
  EXPECT_FALSE(announced(kBinary, 24 * (Limits{}.binary_rays + 1)));
  EXPECT_FALSE(announced(kBinary, 24, {{"precision", "best"}}));
  EXPECT_FALSE(announced(kBinary, 24, {{"max_hits", "1"}})) << "not asked of these";
}

}  // namespace
}  // namespace gridcast::proto
