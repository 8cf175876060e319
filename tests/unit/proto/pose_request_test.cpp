#include "proto/pose_request.h"

#include <gtest/gtest.h>

#include "proto/transaction.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

const std::string kRows = "[[1,2,3,4],[5,6,7,8],[9,10,11,12]]";

Parsed<PoseRequest> parse(const std::string& body, const QueryParameters& query = {}) {
  return parse_pose_request(body, query, Limits{});
}

/// The one edit of a transaction, which must be a pose.
PoseEditRequest edit_of(const std::string& edit) {
  const auto parsed = parse_transaction("{\"edits\":[" + edit + "]}", Limits{});
  EXPECT_EQ(outcome(parsed), "ok") << edit;
  return parsed.ok() ? std::get<PoseEditRequest>(parsed.value().at(0)) : PoseEditRequest{};
}

std::string refused_edit(const std::string& edit) {
  return outcome(parse_transaction("{\"edits\":[" + edit + "]}", Limits{}));
}

/// A transform tells rows from columns and one entry from another.
void expect_rows(const Affine& transform) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) EXPECT_EQ(transform.linear[column][row], 4 * row + column + 1);
    EXPECT_EQ(transform.translation[row], 4 * row + 4);
  }
}

TEST(PoseRequest, an_empty_body_is_the_rest_pose) {
  const auto pose = parse("{}");
  ASSERT_EQ(outcome(pose), "ok");
  EXPECT_EQ(pose.value().base, "rest");
  EXPECT_EQ(pose.value().update, "auto");
  EXPECT_FALSE(pose.value().animation);
  EXPECT_TRUE(pose.value().nodes.empty() && pose.value().skins.empty() && pose.value().weights.empty());
}

TEST(PoseRequest, an_animation_goes_by_name_or_by_index) {
  const auto named = parse(R"({"animation":"bend","time_s":-1.5,"wrap":"loop","base":"present"})");
  ASSERT_EQ(outcome(named), "ok");
  EXPECT_EQ(std::get<std::string>(named.value().animation->animation), "bend");
  EXPECT_EQ(named.value().animation->time_s, -1.5);
  EXPECT_EQ(named.value().animation->wrap, "loop");
  EXPECT_EQ(named.value().base, "present");
  const auto numbered = parse(R"({"animation_id":3})");
  ASSERT_EQ(outcome(numbered), "ok");
  EXPECT_EQ(std::get<std::uint32_t>(numbered.value().animation->animation), 3U);
  EXPECT_EQ(numbered.value().animation->time_s, 0.0);
  EXPECT_EQ(numbered.value().animation->wrap, "clamp");
}

TEST(PoseRequest, nodes_take_a_transform_or_the_parts_that_change) {
  const auto pose = parse(R"({"nodes":[{"node_id":7,"transform":)" + kRows +
                          R"(},{"node":"hip","rotation":[0.5,-0.5,0.25,1],"scale":[2,3,4]},)"
                          R"({"node_id":0,"translation":[1,2,3]}]})");
  ASSERT_EQ(outcome(pose), "ok");
  const std::vector<PoseNode>& nodes = pose.value().nodes;
  ASSERT_EQ(nodes.size(), 3U);
  EXPECT_EQ(std::get<std::uint32_t>(nodes[0].node), 7U);
  expect_rows(nodes[0].transform.value());
  EXPECT_FALSE(nodes[0].translation || nodes[0].rotation || nodes[0].scale);
  EXPECT_EQ(std::get<std::string>(nodes[1].node), "hip");
  EXPECT_EQ(nodes[1].rotation, (std::array<double, 4>{0.5, -0.5, 0.25, 1}));
  EXPECT_EQ(nodes[1].scale, Vec3d(2, 3, 4));
  EXPECT_FALSE(nodes[1].transform || nodes[1].translation);
  EXPECT_EQ(nodes[2].translation, Vec3d(1, 2, 3));
  EXPECT_FALSE(nodes[2].rotation || nodes[2].scale);
}

TEST(PoseRequest, skins_and_weights_keep_their_order) {
  const auto pose =
      parse(R"({"skins":[{"skin":"bones","joint_matrices":[)" + kRows + "," + kRows +
            R"(]},{"skin_id":1,"joint_matrices":[]}],"weights":[{"mesh_id":4,"weights":[0,0.25]},)"
            R"({"mesh_id":2,"weights":[-1]}],"update":"refit"})");
  ASSERT_EQ(outcome(pose), "ok");
  ASSERT_EQ(pose.value().skins.size(), 2U);
  EXPECT_EQ(std::get<std::string>(pose.value().skins[0].skin), "bones");
  ASSERT_EQ(pose.value().skins[0].joint_matrices.size(), 2U);
  expect_rows(pose.value().skins[0].joint_matrices[1]);
  EXPECT_EQ(std::get<std::uint32_t>(pose.value().skins[1].skin), 1U);
  ASSERT_EQ(pose.value().weights.size(), 2U);
  EXPECT_EQ(pose.value().weights[0].mesh_id, 4U);
  EXPECT_EQ(pose.value().weights[0].weights, (std::vector<double>{0, 0.25}));
  EXPECT_EQ(pose.value().weights[1].mesh_id, 2U);
  EXPECT_EQ(pose.value().update, "refit");
}

TEST(PoseRequest, what_is_wrong_is_pointed_at) {
  EXPECT_EQ(outcome(parse("[]")), "wrong_type 422 ");
  EXPECT_EQ(outcome(parse(R"({"op":"set_pose"})")), "unknown_field 422 /op") << "of transactions alone";
  EXPECT_EQ(outcome(parse(R"({"base":"bind"})")), "invalid_value 422 /base");
  EXPECT_EQ(outcome(parse(R"({"animation":"a","animation_id":0})")), "invalid_value 422 /animation");
  EXPECT_EQ(outcome(parse(R"({"time_s":1})")), "invalid_value 422 /time_s") << "without an animation";
  EXPECT_EQ(outcome(parse(R"({"wrap":"loop"})")), "invalid_value 422 /wrap");
  EXPECT_EQ(outcome(parse(R"({"animation_id":0,"wrap":"mirror"})")), "invalid_value 422 /wrap");
  EXPECT_EQ(outcome(parse(R"({"animation_id":-1})")), "out_of_range 422 /animation_id");
  EXPECT_EQ(outcome(parse(R"({"animation_id":4294967295})")), "out_of_range 422 /animation_id");
  EXPECT_EQ(outcome(parse(R"({"nodes":[{"scale":[1,1,1]}]})")), "missing_field 422 /nodes/0/node_id");
  EXPECT_EQ(outcome(parse(R"({"nodes":[{"node_id":0,"node":"a"}]})")), "invalid_value 422 /nodes/0/node");
  EXPECT_EQ(outcome(parse(R"({"nodes":[{"node_id":0},{"node_id":1,"rotation":[0,0,1]}]})")),
            "wrong_length 422 /nodes/1/rotation");
  EXPECT_EQ(outcome(parse(R"({"nodes":[{"node_id":0,"mesh":1}]})")), "unknown_field 422 /nodes/0/mesh");
  EXPECT_EQ(outcome(parse(R"({"skins":[{"joint_matrices":[]}]})")), "missing_field 422 /skins/0/skin_id");
  EXPECT_EQ(outcome(parse(R"({"skins":[{"skin_id":0}]})")), "missing_field 422 /skins/0/joint_matrices");
  EXPECT_EQ(outcome(parse(R"({"weights":[{"weights":[1]}]})")), "missing_field 422 /weights/0/mesh_id");
  EXPECT_EQ(outcome(parse(R"({"weights":[{"mesh_id":0,"weights":[1,null]}]})")),
            "wrong_type 422 /weights/0/weights/1");
}

TEST(PoseRequest, a_transform_excludes_each_of_the_parts) {
  for (const std::string part :
       {R"("translation":[0,0,0])", R"("rotation":[0,0,0,1])", R"("scale":[1,1,1])"}) {
    const std::string node = R"({"node_id":0,"transform":)" + kRows + "," + part + "}";
    EXPECT_EQ(outcome(parse("{\"nodes\":[" + node + "]}")), "invalid_value 422 /nodes/0/transform") << part;
  }
}

TEST(PoseRequest, the_querys_update_wins_and_is_strict) {
  const auto pose = parse(R"({"update":"refit"})", {{"update", "rebuild"}});
  ASSERT_EQ(outcome(pose), "ok");
  EXPECT_EQ(pose.value().update, "rebuild");
  EXPECT_EQ(outcome(parse("{}", {{"update", "always"}})), "invalid_value 422 ?update");
  EXPECT_EQ(outcome(parse("{}", {{"base", "rest"}})), "unknown_parameter 422 ?base");
  EXPECT_EQ(outcome(parse("{", {{"base", "rest"}})), "invalid_json 400 ") << "the body comes first";
}

TEST(WeightsRequest, is_a_pose_that_changes_one_mesh_over_the_present_one) {
  const auto pose =
      parse_weights_request(5, R"({"weights":[0.5,-2],"update":"rebuild"})", {{"update", "auto"}}, Limits{});
  ASSERT_EQ(outcome(pose), "ok");
  EXPECT_EQ(pose.value().base, "present");
  EXPECT_EQ(pose.value().update, "auto");
  ASSERT_EQ(pose.value().weights.size(), 1U);
  EXPECT_EQ(pose.value().weights[0].mesh_id, 5U);
  EXPECT_EQ(pose.value().weights[0].weights, (std::vector<double>{0.5, -2}));
  const auto refused = [](const std::string& body) {
    return outcome(parse_weights_request(5, body, {}, Limits{}));
  };
  EXPECT_EQ(refused("{}"), "missing_field 422 /weights");
  EXPECT_EQ(refused(R"({"weights":[1],"mesh_id":5})"), "unknown_field 422 /mesh_id") << "the path names it";
  EXPECT_EQ(refused(R"({"weights":["1"]})"), "wrong_type 422 /weights/0");
  EXPECT_EQ(refused(R"({"weights":1})"), "wrong_type 422 /weights");
}

TEST(PoseEdits, have_their_op_beside_the_members_of_a_pose) {
  const PoseEditRequest pose =
      edit_of(R"({"op":"set_pose","animation":"bend","time_s":2,"update":"rebuild"})");
  EXPECT_EQ(pose.op, "set_pose");
  EXPECT_EQ(pose.pose.base, "rest");
  EXPECT_EQ(pose.pose.animation->time_s, 2.0);
  EXPECT_EQ(pose.pose.update, "rebuild");
  const PoseEditRequest weights =
      edit_of(R"({"op":"set_weights","mesh_id":1,"weights":[1,0],"update":"refit"})");
  EXPECT_EQ(weights.op, "set_weights");
  EXPECT_EQ(weights.pose.base, "present");
  EXPECT_EQ(weights.pose.weights.at(0).mesh_id, 1U);
  EXPECT_EQ(weights.pose.weights.at(0).weights, (std::vector<double>{1, 0}));
  EXPECT_EQ(weights.pose.update, "refit");
}

TEST(PoseEdits, point_into_the_transaction_when_they_are_wrong) {
  const std::string good = R"({"op":"set_pose"},)";
  EXPECT_EQ(refused_edit(good + R"({"op":"set_weights","weights":[1]})"),
            "missing_field 422 /edits/1/mesh_id");
  EXPECT_EQ(refused_edit(good + R"({"op":"set_weights","mesh_id":1})"), "missing_field 422 /edits/1/weights");
  EXPECT_EQ(refused_edit(R"({"op":"set_weights","mesh_id":1,"weights":[1],"base":"rest"})"),
            "unknown_field 422 /edits/0/base");
  EXPECT_EQ(refused_edit(R"({"op":"set_pose","mesh_id":1})"), "unknown_field 422 /edits/0/mesh_id");
  EXPECT_EQ(refused_edit(good + R"({"op":"set_pose","nodes":[{"node_id":0,"rotation":[1]}]})"),
            "wrong_length 422 /edits/1/nodes/0/rotation");
}

}  // namespace
}  // namespace gridcast::proto
