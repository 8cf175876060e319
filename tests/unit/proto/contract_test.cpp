// The error table, the vocabulary and the limits against the published contract.

#include <set>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/error_table.h"
#include "proto/explain_request.h"
#include "proto/limits.h"
#include "proto/openapi.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

using Json = nlohmann::json;

const Json& contract() {
  static const Json document = Json::parse(openapi_json());
  return document;
}
const Json& schema(const std::string& name) {
  return contract().at("components").at("schemas").at(name);
}

TEST(Contract, every_problem_code_is_published_and_every_published_one_exists) {
  std::set<std::string> table;
  for (const ProblemKind& kind : all_problems()) {
    EXPECT_TRUE(table.insert(std::string(kind.name)).second) << kind.name << " is in the table twice";
    EXPECT_GE(kind.status, 400);
    EXPECT_LT(kind.status, 600);
    EXPECT_FALSE(kind.title.empty());
  }
  EXPECT_EQ(table, schema("ProblemCode").at("enum").get<std::set<std::string>>());
}

TEST(Contract, titles_are_unique) {
  std::set<std::string_view> titles;
  for (const ProblemKind& kind : all_problems()) EXPECT_TRUE(titles.insert(kind.title).second) << kind.title;
}

template <class Names>
Json words(const Names& names) {
  return Json(std::vector<std::string>(names.begin(), names.end()));
}

TEST(Contract, vocabularies_are_the_published_ones) {
  EXPECT_EQ(words(kStructureNames), schema("StructureName").at("enum"));
  EXPECT_EQ(words(kBuildQualityNames), schema("BuildQuality").at("enum"));
  EXPECT_EQ(words(kPrecisionNames), schema("Precision").at("enum"));
  EXPECT_EQ(words(kUpdateModeNames), schema("UpdateMode").at("enum"));
  EXPECT_EQ(words(kHitFieldNames), schema("HitField").at("enum"));
  EXPECT_EQ(words(kSensorTypeNames), schema("Sensor").at("properties").at("type").at("enum"));
  EXPECT_EQ(words(kLayerNames), schema("LayerName").at("enum"));
  EXPECT_EQ(words(kIntegratorNames), schema("Render").at("properties").at("integrator").at("enum"));
  const Json& reply = schema("TransactionReply").at("properties").at("edits").at("items").at("properties");
  EXPECT_EQ(words(kEditNames), reply.at("op").at("enum"));
  const Json& edits = schema("Transaction").at("properties").at("edits").at("items").at("oneOf");
  for (std::size_t i = 0; i < kEditNames.size(); ++i)
    EXPECT_EQ(edits.at(i).at("properties").at("op").at("const"), kEditNames[i]);
  EXPECT_EQ(words(kRayClassNames), schema("RayClass").at("enum"));
  EXPECT_EQ(words(kBuiltStructureNames), schema("StructureKind").at("enum"));
  const auto step = [](const char* kind, const char* member) {
    return schema(kind).at("properties").at(member).at("enum");
  };
  EXPECT_EQ(words(kCellContentNames), step("CellStep", "content"));
  EXPECT_EQ(words(kInstanceOutcomeNames), step("InstanceStep", "outcome"));
  EXPECT_EQ(words(kTriangleVerdictNames), step("TriangleStep", "verdict"));
  EXPECT_EQ(words(kImageFormatNames), schema("Render").at("properties").at("format").at("enum"));
}

TEST(Contract, published_limits_are_the_defaults) {
  const Limits limits;
  const Json& render = schema("Render").at("properties");
  EXPECT_EQ(render.at("width_px").at("maximum"), limits.image_side_px);
  EXPECT_EQ(render.at("samples").at("maximum"), limits.samples_per_pixel);
  EXPECT_EQ(render.at("max_depth").at("maximum"), limits.bounce_depth);
  const Json& sweep = schema("TradeoffSweep").at("properties");
  EXPECT_EQ(sweep.at("accuracy_rays").at("maximum"), limits.tradeoff_accuracy_rays);
  EXPECT_EQ(sweep.at("speed_rays").at("maximum"), limits.tradeoff_speed_rays);
  EXPECT_EQ(sweep.at("repeat").at("maximum"), limits.tradeoff_repeat);
  EXPECT_EQ(sweep.at("deadline_ms").at("maximum"), limits.job_deadline_ms);
  EXPECT_EQ(schema("Rays").at("properties").at("origins").at("maxItems"), limits.json_rays);
  EXPECT_EQ(schema("Rays").at("properties").at("deadline_ms").at("maximum"), limits.deadline_ms);
  const Json& explain = schema("RayToExplain").at("properties");
  EXPECT_EQ(explain.at("max_steps").at("maximum"), limits.explain_steps);
  EXPECT_EQ(explain.at("max_steps").at("default"), kDefaultExplainSteps);
  EXPECT_EQ(explain.at("deadline_ms").at("maximum"), limits.deadline_ms);
  const Json& lists = schema("RaysForLists").at("properties");
  EXPECT_EQ(lists.at("max_hits").at("maximum"), limits.hits_per_ray);
  EXPECT_EQ(lists.at("origins").at("maxItems"), limits.json_rays);
  EXPECT_EQ(schema("Points").at("properties").at("points").at("maxItems"), limits.json_rays);
  EXPECT_EQ(schema("Moves").at("properties").at("moves").at("maxItems"), limits.instances_per_patch);
  EXPECT_EQ(schema("Transaction").at("properties").at("edits").at("maxItems"), limits.transaction_edits);
  EXPECT_EQ(schema("NewInstance").at("properties").at("name").at("maxLength"), limits.name_bytes);
  const Json published = Json::parse(to_json(limits));
  for (const auto& [name, property] : schema("Limits").at("properties").items())
    EXPECT_TRUE(published.contains(name)) << name;
  EXPECT_EQ(published.size(), schema("Limits").at("properties").size());
}

TEST(Problem, is_written_as_rfc_9457_with_code_and_pointer) {
  EXPECT_EQ(to_json(Problem{ProblemCode::kWrongLength, "must have exactly 3 numbers", "/directions/3"}),
            R"({"type":"urn:gridcast:problem:wrong_length","title":"A length does not fit","status":422,)"
            R"("code":"wrong_length","detail":"must have exactly 3 numbers","pointer":"/directions/3"})");
}

TEST(Problem, bytes_that_are_not_text_never_break_the_answer) {
  const Json json = Json::parse(to_json(Problem{ProblemCode::kUnknownField, "x", "/\xFF\x01\""}));
  EXPECT_EQ(json.at("pointer"), "/\xEF\xBF\xBD\x01\"");
}

TEST(Problem, errors_of_core_get_the_code_of_their_context) {
  const Error unsupported{ErrorCode::kUnsupported, "no", "/extensionsRequired/0"};
  EXPECT_EQ(to_problem(unsupported, ErrorContext::kImport).code, ProblemCode::kUnsupportedExtension);
  EXPECT_EQ(to_problem(unsupported, ErrorContext::kUpdate).code, ProblemCode::kCannotRefit);
  EXPECT_EQ(to_problem({ErrorCode::kInvalidFile, "bad", "/x"}, ErrorContext::kImport).pointer, "/x");
  const Problem secret = to_problem({ErrorCode::kIo, "/home/user: denied", "/x"}, ErrorContext::kImport);
  EXPECT_EQ(secret.code, ProblemCode::kInternal);
  EXPECT_EQ(secret.detail.find("/home"), std::string::npos);
  EXPECT_EQ(secret.pointer, "");
}

}  // namespace
}  // namespace gridcast::proto
