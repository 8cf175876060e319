// Requests on scenes, instances, vertices and pictures that are fine.

#include "proto/scene_request.h"

#include <cstring>

#include <gtest/gtest.h>

#include "proto/media_type.h"
#include "proto/render_request.h"
#include "proto/vertex_request.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

TEST(SceneRequest, transforms_are_rows_with_the_translation_last) {
  for (const std::string last : {"", ",[0,0,0,1]", ",[0,0.0,-0.0,1e0]"}) {
    const auto move =
        parse_change_instance(R"({"transform":[[1,2,3,4],[5,6,7,8],[9,10,11,12])" + last + "]}", Limits{});
    ASSERT_EQ(outcome(move), "ok");
    const Affine& m = move.value().world_from_object.value();
    EXPECT_FALSE(move.value().mask || move.value().name);
    EXPECT_EQ(m.translation, Vec3d(4, 8, 12));
    EXPECT_EQ(m.vector({1, 0, 0}), Vec3d(1, 5, 9));
    EXPECT_EQ(m.vector({0, 0, 1}), Vec3d(3, 7, 11));
  }
}

TEST(SceneRequest, an_added_instance_stands_at_the_origin_by_default) {
  const auto add = parse_add_instance(R"({"mesh_id":3,"name":"links \u00fc"})", Limits{});
  ASSERT_EQ(outcome(add), "ok");
  EXPECT_EQ(add.value().mesh_id, 3U);
  EXPECT_EQ(add.value().world_from_object, Affine());
  EXPECT_EQ(add.value().name, "links \xC3\xBC");
}

TEST(SceneRequest, the_query_names_the_scene_and_its_structure) {
  const auto query = parse_scene_query(
      {{"name", "lab"}, {"structure", "kd_tree"}, {"quality", "fast"}, {"scene", "2"}}, Limits{});
  ASSERT_EQ(outcome(query), "ok");
  EXPECT_EQ(query.value().name, "lab");
  EXPECT_EQ(query.value().structure, "kd_tree");
  EXPECT_EQ(query.value().quality, "fast");
  EXPECT_EQ(parse_scene_query({}, Limits{}).value().quality, "default");
  EXPECT_EQ(outcome(parse_scene_query({{"quality", "best"}}, Limits{})), "invalid_value 422 ?quality");
  EXPECT_EQ(query.value().gltf_scene, 2U);
  EXPECT_EQ(outcome(parse_scene_query({{"name", ""}}, Limits{})), "invalid_value 422 ?name");
  EXPECT_EQ(outcome(parse_scene_query({{"name", std::string(64, 'a')}}, Limits{})), "ok");
  EXPECT_EQ(outcome(parse_scene_query({{"name", std::string(65, 'a')}}, Limits{})),
            "invalid_value 422 ?name");
  EXPECT_EQ(outcome(parse_scene_query({{"name", "a\xFF"}}, Limits{})), "invalid_value 422 ?name");
  EXPECT_EQ(outcome(parse_scene_query({{"structure", "octree"}}, Limits{})), "invalid_value 422 ?structure");
  EXPECT_EQ(outcome(parse_scene_query({{"scene", "-1"}}, Limits{})), "out_of_range 422 ?scene");
  EXPECT_EQ(outcome(parse_scene_query({{"scene", "4294967295"}}, Limits{})), "out_of_range 422 ?scene");
  EXPECT_EQ(outcome(parse_scene_query({{"colour", "red"}}, Limits{})), "unknown_parameter 422 ?colour");
}

TEST(SceneRequest, the_number_of_moves_is_limited) {
  Limits limits;
  limits.instances_per_patch = 2;
  std::string moves;
  for (int i = 0; i < 3; ++i) {
    moves += std::string(i == 0 ? "" : ",") + R"({"instance_id":)" + std::to_string(i) +
             R"(,"transform":[[1,0,0,0],[0,1,0,0],[0,0,1,0]]})";
    const auto parsed = parse_move_instances("application/json", "{\"moves\":[" + moves + "]}", limits);
    EXPECT_EQ(outcome(parsed), i < 2 ? "ok" : "out_of_range 422 /moves");
    if (parsed.ok()) {
      EXPECT_EQ(parsed.value().size(), std::size_t(i) + 1);
    }
  }
}

TEST(SceneRequest, a_change_is_what_is_given) {
  const auto mask = parse_change_instance(R"({"mask":0})", Limits{});
  ASSERT_EQ(outcome(mask), "ok");
  EXPECT_EQ(mask.value().mask, InstanceMask(0));
  EXPECT_FALSE(mask.value().world_from_object || mask.value().name);
  const auto name = parse_change_instance(R"({"name":"","mask":255.0})", Limits{});
  ASSERT_EQ(outcome(name), "ok");
  EXPECT_EQ(name.value().name, "");
  EXPECT_EQ(name.value().mask, kFullMask);
  EXPECT_EQ(parse_add_instance(R"({"mesh_id":3})", Limits{}).value().mask, kFullMask);
  EXPECT_EQ(parse_add_instance(R"({"mesh_id":3,"mask":6})", Limits{}).value().mask, 6U);
}

TEST(SceneRequest, moves_stay_moves_until_one_changes_more) {
  const std::string move = R"({"instance_id":4,"transform":[[1,0,0,7],[0,1,0,0],[0,0,1,0]]})";
  const auto moves = parse_move_instances("application/json", R"({"moves":[)" + move + "]}", Limits{});
  ASSERT_EQ(outcome(moves), "ok");
  ASSERT_EQ(moves.value().moves.size(), 1U);
  EXPECT_TRUE(moves.value().changes.empty());
  const auto both = parse_move_instances(
      "application/json", R"({"moves":[)" + move + R"(,{"instance_id":2,"mask":4,"name":"x"}]})", Limits{});
  ASSERT_EQ(outcome(both), "ok");
  EXPECT_TRUE(both.value().moves.empty());
  ASSERT_EQ(both.value().changes.size(), 2U);
  EXPECT_EQ(both.value().changes[0].instance_id, 4U);
  EXPECT_EQ(both.value().changes[0].change.world_from_object.value().translation, Vec3d(7, 0, 0));
  EXPECT_FALSE(both.value().changes[0].change.mask);
  EXPECT_EQ(both.value().changes[1].instance_id, 2U);
  EXPECT_EQ(both.value().changes[1].change.mask, InstanceMask(4));
  EXPECT_EQ(both.value().changes[1].change.name, "x");
}

/// uint32 ids, then 3x4 rows counting up from 1.
template <class Scalar>
std::string binary_moves(const std::vector<std::uint32_t>& ids) {
  std::string body(reinterpret_cast<const char*>(ids.data()), ids.size() * sizeof(std::uint32_t));
  std::vector<Scalar> rows(ids.size() * 12);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = Scalar(i + 1);
  return body.append(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof(Scalar));
}

TEST(SceneRequest, binary_moves_are_ids_and_then_rows) {
  const std::string type(kInstancesMediaType);
  for (const bool is_float : {false, true}) {
    const auto moves =
        is_float ? parse_move_instances(type + "; dtype=float32", binary_moves<float>({7, 3}), Limits{})
                 : parse_move_instances(type, binary_moves<double>({7, 3}), Limits{});
    ASSERT_EQ(outcome(moves), "ok");
    const std::vector<InstanceMove>& read = moves.value().moves;
    ASSERT_EQ(read.size(), 2U);
    EXPECT_EQ(read[0].instance_id, 7U);
    EXPECT_EQ(read[1].instance_id, 3U);
    EXPECT_EQ(read[0].world_from_object.translation, Vec3d(4, 8, 12));
    EXPECT_EQ(read[1].world_from_object.translation, Vec3d(16, 20, 24));
    EXPECT_EQ(read[0].world_from_object.vector({1, 0, 0}), Vec3d(1, 5, 9));
  }
}

TEST(SceneRequest, binary_moves_that_do_not_fit_are_refused) {
  const std::string type(kInstancesMediaType);
  const std::string body = binary_moves<double>({7, 3});
  for (std::size_t n = 0; n <= body.size(); ++n)
    EXPECT_EQ(outcome(parse_move_instances(type, body.substr(0, n), Limits{})),
              n == 100 || n == 200 ? "ok" : "wrong_length 422 ")
        << n;
  EXPECT_EQ(outcome(parse_move_instances(type, binary_moves<double>({7, 3, 5, 3}), Limits{})),
            "duplicate_id 422 /moves/3/instance_id");
  EXPECT_EQ(outcome(parse_move_instances(type + "; dtype=int8", body, Limits{})),
            "unsupported_media_type 415 Content-Type");
  EXPECT_EQ(outcome(parse_move_instances(type + "; rows=3", body, Limits{})),
            "unsupported_media_type 415 Content-Type");
  EXPECT_EQ(outcome(parse_move_instances("text/plain", body, Limits{})),
            "unsupported_media_type 415 Content-Type");
  Limits limits;
  limits.binary_instances = 1;
  EXPECT_EQ(outcome(parse_move_instances(type, body, limits)), "out_of_range 422 /moves");
  limits.binary_bytes = 199;
  EXPECT_EQ(outcome(parse_move_instances(type, body, limits)), "payload_too_large 413 ");
}

TEST(SceneRequest, pages_have_a_largest_size) {
  EXPECT_EQ(parse_page({}, 10'000).value().limit, 1000U);
  EXPECT_EQ(parse_page({{"limit", "10000"}, {"offset", "7"}}, 10'000).value().offset, 7U);
  EXPECT_EQ(outcome(parse_page({{"limit", "10001"}}, 10'000)), "out_of_range 422 ?limit");
  EXPECT_EQ(outcome(parse_page({{"limit", "0"}}, 10'000)), "out_of_range 422 ?limit");
  EXPECT_EQ(outcome(parse_page({{"offset", "1.5"}}, 10'000)), "out_of_range 422 ?offset");
}

TEST(VertexRequest, binary_bodies_are_whole_or_sparse) {
  const std::vector<float> positions{1, 2, 3, 4, 5, 6};
  std::string whole(reinterpret_cast<const char*>(positions.data()), 24);
  const std::string type = "application/vnd.gridcast.vertices";
  const auto all = parse_vertex_request(type, whole, {{"update", "rebuild"}}, Limits{});
  ASSERT_EQ(outcome(all), "ok");
  EXPECT_EQ(all.value().positions[1], Vec3f(4, 5, 6));
  EXPECT_TRUE(all.value().vertex_ids.empty());
  EXPECT_EQ(all.value().update, "rebuild");

  const std::vector<std::uint32_t> ids{9, 4};
  const std::string sparse = std::string(reinterpret_cast<const char*>(ids.data()), 8) + whole;
  const auto some = parse_vertex_request(type + "; layout=sparse", sparse, {}, Limits{});
  ASSERT_EQ(outcome(some), "ok");
  EXPECT_EQ(some.value().vertex_ids, ids);
  EXPECT_EQ(some.value().positions[0], Vec3f(1, 2, 3));

  for (std::size_t n = 0; n < whole.size(); ++n) {
    const std::string expected = n == 12 ? "ok" : "wrong_length 422 ";
    EXPECT_EQ(outcome(parse_vertex_request(type, whole.substr(0, n), {}, Limits{})), expected) << n;
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(whole.data() + 20, &nan, 4);
  EXPECT_EQ(outcome(parse_vertex_request(type, whole, {}, Limits{})), "out_of_range 422 /positions/1");
  EXPECT_EQ(outcome(parse_vertex_request(type + "; layout=dense", whole, {}, Limits{})),
            "unsupported_media_type 415 Content-Type");
  EXPECT_EQ(outcome(parse_vertex_request(type, whole.substr(0, 12), {{"update", "now"}}, Limits{})),
            "invalid_value 422 ?update");
}

TEST(RenderRequest, format_and_accept_agree) {
  const auto format = [](const std::string& body, const std::string& accept) {
    return parse_render_request(body, accept, Limits{}).value().format;
  };
  EXPECT_EQ(format("{}", ""), ImageFormat::kPng);
  EXPECT_EQ(format("{}", "image/x-exr"), ImageFormat::kExr);
  EXPECT_EQ(format("{}", "image/x-exr, image/png;q=0.5"), ImageFormat::kExr);
  EXPECT_EQ(format(R"({"format":"exr"})", "*/*"), ImageFormat::kExr);
  EXPECT_EQ(format(R"({"format":"png"})", "image/*"), ImageFormat::kPng);
}

TEST(RenderRequest, a_camera_is_automatic_of_the_file_or_placed) {
  EXPECT_TRUE(std::holds_alternative<AutoCamera>(
      parse_render_request(R"({"camera":"auto"})", "", Limits{}).value().camera));
  EXPECT_EQ(std::get<FileCamera>(parse_render_request(R"({"camera":2})", "", Limits{}).value().camera).index,
            2U);
  const auto placed = parse_render_request(
      R"({"camera":{"eye":[1,2,3],"target":[0,0,0],"yfov_deg":30},"width_px":4,"precision":"fast"})", "",
      Limits{});
  const auto camera = std::get<LookAtCamera>(placed.value().camera);
  EXPECT_EQ(camera.eye, Vec3d(1, 2, 3));
  EXPECT_EQ(camera.up, Vec3d(0, 1, 0));
  EXPECT_EQ(camera.yfov_deg, 30.0);
  EXPECT_EQ(placed.value().width_px, 4);
  EXPECT_EQ(placed.value().precision, Precision::kFast);
}

}  // namespace
}  // namespace gridcast::proto
