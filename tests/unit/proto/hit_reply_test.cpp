#include "proto/hit_reply.h"

#include <bit>
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/random.h"

namespace gridcast::proto {
namespace {

HitColumns hit_and_miss(HitField fields) {
  HitColumns hits;
  hits.resize(3, fields);
  SurfaceHit hit{RayStatus::kHit, 4.0, 0.2F, 0.5F, {0.0, -0.0, 1.0}, 2, 0, 11};
  hits.set(0, hit);
  SurfaceHit invalid;
  invalid.status = RayStatus::kInvalid;
  hits.set(2, invalid);
  return hits;
}

TEST(HitReply, json_is_columns_with_null_for_a_miss) {
  EXPECT_EQ(write_hits_json(hit_and_miss(HitField::kAll), {7, HitField::kAll, {}}),
            R"({"scene_version":"7","status":[1,0,4],"t":[4,null,null],"instance_id":[2,null,null],)"
            R"("mesh_id":[0,null,null],"primitive_id":[11,null,null],"uv":[[0.2,0.5],null,null],)"
            R"("normal":[[0,-0.0,1],null,null]})");
  EXPECT_EQ(write_hits_json(hit_and_miss(HitField::kUv), {8, HitField::kUv, {}}),
            R"({"scene_version":"8","status":[1,0,4],"t":[4,null,null],"uv":[[0.2,0.5],null,null]})");
}

TEST(HitReply, t_error_is_a_column_when_asked_for_and_null_where_infinite) {
  HitColumns hits;
  hits.resize(3, HitField::kTError);
  SurfaceHit hit{RayStatus::kHit, 4.0, 0.2, 0.5, {0.0, 0.0, 1.0}, 2, 0, 11, 0x1p-52};
  hits.set(0, hit);
  hit.t_error = std::numeric_limits<double>::infinity();
  hits.set(1, hit);
  EXPECT_EQ(write_hits_json(hits, {7, HitField::kTError, {}}),
            R"({"scene_version":"7","status":[1,1,0],"t":[4,4,null],)"
            R"("t_error":[2.220446049250313e-16,null,null]})");
  EXPECT_FALSE(has(HitField::kAll, HitField::kTError));
}

TEST(HitReply, statuses_are_counted) {
  const std::vector<RayStatus> status{RayStatus::kHit, RayStatus::kMiss, RayStatus::kInvalid,
                                      RayStatus::kHit};
  const RayStats stats = count_statuses(status, 3.0);
  EXPECT_EQ(stats.rays, 4U);
  EXPECT_EQ(stats.hits, 2U);
  EXPECT_EQ(stats.misses, 1U);
  EXPECT_EQ(stats.invalid, 1U);
  EXPECT_EQ(stats.trace_ms, 3.0);
}

TEST(HitReply, no_rays_give_empty_columns) {
  HitColumns hits;
  hits.resize(0, HitField::kMeshId);
  EXPECT_EQ(write_hits_json(hits, {1, HitField::kMeshId, {}}),
            R"({"scene_version":"1","status":[],"t":[],"mesh_id":[]})");
  const std::string body = write_hits_binary(hits, {1, HitField::kMeshId, {}}).to_string();
  EXPECT_EQ(body.size() % 8, 0U);
}

TEST(HitReply, occlusion_and_stats_have_their_golden_text) {
  const std::vector<RayStatus> status{RayStatus::kHit, RayStatus::kMiss, RayStatus::kInvalid};
  ReplyHead head{7, HitField::kAll, {}};
  EXPECT_EQ(write_occlusion_json(status, head),
            R"({"scene_version":"7","status":[1,0,4],"occluded":[true,false,null]})");
  head.stats = count_statuses(status, 1.5);
  EXPECT_EQ(write_occlusion_json({}, head),
            R"({"scene_version":"7","status":[],"occluded":[],"stats":{"rays":3,"hits":1,"misses":1,)"
            R"("invalid":1,"trace_ms":1.5}})");
  head.stats->plan = RayPlan{"by_origin", "neighbours start far apart", 16, 2, 0.5};
  EXPECT_EQ(write_occlusion_json({}, head),
            R"({"scene_version":"7","status":[],"occluded":[],"stats":{"rays":3,"hits":1,"misses":1,)"
            R"("invalid":1,"trace_ms":1.5,"order":"by_origin","order_reason":"neighbours start far apart",)"
            R"("order_ms":0.5,"packet_rays":16,"single_rays":2}})");
}

/// A reader of the binary form written from its description alone.
struct Decoded {
  nlohmann::json head;
  std::string data;
  template <class T>
  Column<T> column(const std::string& name) const {
    const auto begin = head.at(name).at("data_offsets").at(0).get<std::size_t>();
    const auto end = head.at(name).at("data_offsets").at(1).get<std::size_t>();
    EXPECT_EQ(begin % 8, 0U) << name;
    Column<T> values((end - begin) / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), data.data() + begin, end - begin);
    return values;
  }
};

Decoded decode(const std::string& body) {
  std::uint64_t length = 0;
  std::memcpy(&length, body.data(), sizeof length);
  EXPECT_EQ((length + 8) % 8, 0U);
  return {nlohmann::json::parse(body.substr(8, length)), body.substr(8 + length)};
}

TEST(HitReply, binary_columns_are_where_the_head_says) {
  const HitField fields = HitField::kAll | HitField::kTError;
  const HitColumns hits = hit_and_miss(fields);
  const BinaryBody body = write_hits_binary(hits, {7, fields, count_statuses(hits.status, 2.5)});
  const std::string text = body.to_string();
  EXPECT_EQ(text.size(), body.size_bytes());
  const Decoded reply = decode(text);
  EXPECT_EQ(reply.head["__metadata__"]["scene_version"], "7");
  EXPECT_EQ(reply.head["__metadata__"]["hits"], "1");
  EXPECT_EQ(reply.head["t"]["dtype"], "F64");
  EXPECT_EQ(reply.head["normal"]["shape"], (nlohmann::json{3, 3}));
  EXPECT_EQ(reply.column<double>("t"), hits.t);
  EXPECT_EQ(reply.column<float>("uv"), hits.uv);
  EXPECT_EQ(reply.column<float>("normal"), hits.normal);
  EXPECT_EQ(reply.column<std::uint32_t>("instance_id"), (Column<std::uint32_t>{2, kInvalidId, kInvalidId}));
  EXPECT_EQ(reply.column<std::uint32_t>("mesh_id"), hits.mesh_id);
  EXPECT_EQ(reply.column<std::uint32_t>("primitive_id"), hits.primitive_id);
  EXPECT_EQ(reply.column<double>("t_error"), hits.t_error);
  EXPECT_EQ(reply.column<std::uint8_t>("status"), (Column<std::uint8_t>{1, 0, 4}));
  EXPECT_EQ(reply.head["status"]["data_offsets"][1], reply.data.size());
}

TEST(HitReply, occlusion_is_one_column) {
  const std::vector<RayStatus> status{RayStatus::kHit, RayStatus::kMiss};
  const Decoded reply = decode(write_occlusion_binary(status, {9, HitField::kAll, {}}).to_string());
  EXPECT_EQ(reply.head.size(), 2U);
  EXPECT_EQ(reply.column<std::uint8_t>("status"), (Column<std::uint8_t>{1, 0}));
}

TEST(HitReply, json_numbers_read_back_to_the_same_bits) {
  test::Random random(test::seed_or(21));
  constexpr std::size_t kCount = 5000;
  HitColumns hits;
  hits.resize(kCount, HitField::kUv);
  for (std::size_t i = 0; i < kCount; ++i) {
    hits.status[i] = RayStatus::kHit;
    do {
      hits.t[i] = std::bit_cast<double>(random.bits());
    } while (!std::isfinite(hits.t[i]));
    do {
      hits.uv[2 * i] = std::bit_cast<float>(std::uint32_t(random.bits()));
    } while (!std::isfinite(hits.uv[2 * i]));
    hits.uv[2 * i + 1] = float(random.uniform());
  }
  hits.t[0] = -0.0;
  hits.t[1] = 0.0;
  const auto json = nlohmann::json::parse(write_hits_json(hits, {1, HitField::kUv, {}}));
  for (std::size_t i = 0; i < kCount; ++i) {
    ASSERT_EQ(std::bit_cast<std::uint64_t>(json["t"][i].get<double>()),
              std::bit_cast<std::uint64_t>(hits.t[i]));
    for (std::size_t c = 0; c < 2; ++c)
      ASSERT_EQ(std::bit_cast<std::uint32_t>(float(json["uv"][i][c].get<double>())),
                std::bit_cast<std::uint32_t>(hits.uv[2 * i + c]));
  }
}

}  // namespace
}  // namespace gridcast::proto
