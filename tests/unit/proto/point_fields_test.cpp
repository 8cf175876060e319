#include <set>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/point_reply.h"
#include "proto/point_request.h"

namespace gridcast::proto {
namespace {

using Json = nlohmann::json;

Parsed<PointRequest> parse(const std::string& fields, const QueryParameters& query, PointQuestion question) {
  return parse_point_request("application/json", R"({"points":[[0,0,0]])" + fields + "}", query, Limits{},
                             question);
}

TEST(PointFields, all_come_unless_some_are_named) {
  for (const PointQuestion question : {PointQuestion::kClosest, PointQuestion::kInside})
    EXPECT_EQ(parse("", {}, question).value().fields, PointField::kAll);
  const auto near = parse(R"(,"fields":["uv","distance","position"])", {}, PointQuestion::kClosest);
  EXPECT_EQ(near.value().fields, PointField::kUv | PointField::kPosition);
  EXPECT_EQ(parse(R"(,"fields":[])", {}, PointQuestion::kClosest).value().fields, PointField::kNone);
  const auto rows = parse(R"(,"fields":["winding"])", {}, PointQuestion::kInside);
  EXPECT_EQ(rows.value().fields, PointField::kWinding | PointField::kSplits) << "rows need their splits";
  EXPECT_EQ(parse(R"(,"fields":["place"])", {}, PointQuestion::kInside).value().fields, PointField::kNone);
}

TEST(PointFields, the_query_string_wins) {
  const auto request =
      parse(R"(,"fields":["uv"])", {{"fields", "mesh_id,primitive_id"}}, PointQuestion::kClosest);
  EXPECT_EQ(request.value().fields, PointField::kMeshId | PointField::kPrimitiveId);
  EXPECT_EQ(parse(R"(,"fields":["uv"])", {{"fields", ""}}, PointQuestion::kClosest).value().fields,
            PointField::kNone);
}

TEST(PointFields, every_name_is_known_to_its_own_question_alone) {
  for (const auto name : kNearestFieldNames) EXPECT_TRUE(parse_nearest_field(name)) << name;
  for (const auto name : kInsideFieldNames) EXPECT_TRUE(parse_inside_field(name)) << name;
  for (const char* name : {"t", "place", "winding", "", "UV"})
    EXPECT_FALSE(parse_nearest_field(name)) << name;
  for (const char* name : {"distance", "uv", "primitive_id", ""})
    EXPECT_FALSE(parse_inside_field(name)) << name;
}

TEST(PointFields, other_names_are_refused_with_the_list) {
  const auto wrong = parse(R"(,"fields":["uv","winding"])", {}, PointQuestion::kClosest);
  ASSERT_FALSE(wrong.ok());
  EXPECT_EQ(wrong.problem().code, ProblemCode::kInvalidValue);
  EXPECT_EQ(wrong.problem().pointer, "/fields/1");
  for (const auto name : kNearestFieldNames)
    EXPECT_NE(wrong.problem().detail.find(name), std::string::npos) << wrong.problem().detail;
  const auto query = parse("", {{"fields", "uv"}}, PointQuestion::kInside);
  ASSERT_FALSE(query.ok());
  EXPECT_EQ(query.problem().pointer, "?fields");
  EXPECT_NE(query.problem().detail.find("open_meshes"), std::string::npos) << query.problem().detail;
  for (const char* fields : {R"(,"fields":"uv")", R"(,"fields":[1])", R"(,"fields":null)"})
    EXPECT_EQ(parse(fields, {}, PointQuestion::kClosest).problem().code, ProblemCode::kWrongType) << fields;
}

std::set<std::string> members(const std::string& text) {
  std::set<std::string> names;
  const Json object = Json::parse(text);
  for (const auto& [name, value] : object.items()) names.insert(name);
  return names;
}
std::set<std::string> columns(const BinaryBody& body) {
  auto names = members(body.head.substr(8));
  names.erase("__metadata__");
  return names;
}

TEST(PointFields, answers_have_the_columns_that_are_wanted) {
  NearestColumns nearest;
  nearest.resize(2);
  InsideColumns inside;
  inside.place.resize(2);
  inside.splits.resize(3);
  const auto nearest_both = [&](PointField fields) {
    const auto text = members(write_nearest_json(nearest, {}, fields));
    auto binary = columns(write_nearest_binary(nearest, {}, fields));
    binary.insert("scene_version");
    EXPECT_EQ(text, binary);
    return text.size();
  };
  EXPECT_EQ(nearest_both(PointField::kNone), 3U) << "version, status, distance";
  EXPECT_EQ(nearest_both(PointField::kAll), 8U);
  for (const auto name : kNearestFieldNames) {
    const PointField field = *parse_nearest_field(name);
    EXPECT_EQ(nearest_both(field), field == PointField::kNone ? 3U : 4U) << name;
    EXPECT_TRUE(members(write_nearest_json(nearest, {}, field)).contains(std::string(name)));
  }
  for (const auto name : kInsideFieldNames) {
    const PointField field = *parse_inside_field(name);
    const auto text = members(write_inside_json(inside, {}, field));
    EXPECT_TRUE(text.contains(std::string(name))) << name;
    EXPECT_EQ(text.contains("splits"), wants(field, PointField::kSplits)) << name;
    auto binary = columns(write_inside_binary(inside, {}, field));
    binary.insert("scene_version");
    EXPECT_EQ(text, binary) << name;
  }
}

}  // namespace
}  // namespace gridcast::proto
