// Bodies that must be refused: each gives its code, its status and the place.

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "proto/point_request.h"
#include "proto/ray_request.h"
#include "proto/render_request.h"
#include "proto/scene_request.h"
#include "proto/transaction.h"
#include "proto/vertex_request.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

struct Case {
  std::string body;
  std::string expected;
};

std::string nested(std::size_t depth) {
  return std::string(depth, '[') + std::string(depth, ']');
}

std::string rays_with(const std::string& members) {
  return R"({"origins":[[0,0,5]],"directions":[[0,0,-1]])" + members + "}";
}

std::string parse_rays(const std::string& body) {
  return outcome(parse_ray_request("application/json", body, {}, Limits{}));
}

TEST(MalformedJson, breaks_of_the_grammar_are_400_with_the_place) {
  const std::vector<Case> cases{
      {"", "invalid_json 400 "},
      {" ", "invalid_json 400 "},
      {"{", "invalid_json 400 "},
      {"}", "invalid_json 400 "},
      {"{]", "invalid_json 400 "},
      {"[}", "invalid_json 400 /0"},
      {"{}}", "invalid_json 400 "},
      {"{} {}", "invalid_json 400 "},
      {"nul", "invalid_json 400 "},
      {"NaN", "invalid_json 400 "},
      {"Infinity", "invalid_json 400 "},
      {R"({"origins":NaN})", "invalid_json 400 /origins"},
      {R"({"origins":[[0,0,Infinity]]})", "invalid_json 400 /origins/0/2"},
      {R"({"origins":[[0,0,-Infinity]]})", "invalid_json 400 /origins/0/2"},
      {R"({"origins":[[0,0,)", "invalid_json 400 /origins/0/2"},
      {R"({"origins":[[0,0,5],]})", "invalid_json 400 /origins/1"},
      {R"({"origins":[[0 0]]})", "invalid_json 400 /origins/0/1"},
      {R"({"origins":[[01,0,0]]})", "invalid_json 400 /origins/0/1"},
      {R"({"origins":[[+1,0,0]]})", "invalid_json 400 /origins/0/0"},
      {R"({"origins":[[.5,0,0]]})", "invalid_json 400 /origins/0/0"},
      {R"({"origins":[[1.,0,0]]})", "invalid_json 400 /origins/0/0"},
      {R"({"origins":[[0x10,0,0]]})", "invalid_json 400 /origins/0/1"},
      {R"({"origins":[[1e,0,0]]})", "invalid_json 400 /origins/0/0"},
      {R"({'origins':[]})", "invalid_json 400 "},
      {R"({origins:[]})", "invalid_json 400 "},
      {R"({"origins" []})", "invalid_json 400 /origins"},
      {R"({"origins":[],})", "invalid_json 400 /origins"},
      {"{\"origins\":\"\n\"}", "invalid_json 400 /origins"},
      {"{\"origins\":\"\\x\"}", "invalid_json 400 /origins"},
      {"{\"origins\":\"\\ud800\"}", "invalid_json 400 /origins"},
      {"{\"origins\":\"\xFF\"}", "invalid_json 400 /origins"},
      {"{\"\xC0\xAF\":1}", "invalid_json 400 "},
      {"{\"origins\":\"\xED\xA0\x80\"}", "invalid_json 400 /origins"},
      {std::string("{\"origins\":\0}", 13), "invalid_json 400 /origins"},
      {"\xEF\xBB\xBF{}", "invalid_json 400 "},
      {"/* c */{}", "invalid_json 400 "},
      {"{\"origins\":[] // c\n}", "invalid_json 400 /origins"},
  };
  for (const Case& c : cases) EXPECT_EQ(parse_rays(c.body), c.expected) << c.body;
}

TEST(MalformedJson, numbers_that_no_type_holds_are_422_with_the_place) {
  const std::vector<Case> cases{
      {R"({"origins":[[1e999,0,0]]})", "out_of_range 422 /origins/0/0"},
      {R"({"origins":[[0,-1e400,0]]})", "out_of_range 422 /origins/0/1"},
      {R"({"origins":[[0,0,18446744073709551616]]})", "out_of_range 422 /origins/0/2"},
      {R"({"origins":[[0,0,-9223372036854775809]]})", "out_of_range 422 /origins/0/2"},
      {R"({"deadline_ms":)" + std::string(400, '9') + "}", "out_of_range 422 /deadline_ms"},
  };
  for (const Case& c : cases) EXPECT_EQ(parse_rays(c.body), c.expected) << c.body;
}

TEST(MalformedJson, depth_is_bounded_before_anything_recurses) {
  const Limits limits;
  EXPECT_EQ(parse_rays(nested(limits.json_depth)), "wrong_type 422 ");
  const std::string too_deep = parse_rays(nested(limits.json_depth + 1));
  EXPECT_EQ(too_deep.substr(0, 13), "too_deep 400 ");
  EXPECT_EQ(parse_rays(nested(4'000'000)).substr(0, 13), "too_deep 400 ");
  EXPECT_EQ(parse_rays(std::string(4'000'000, '[')).substr(0, 8), "too_deep");
  std::string objects;
  for (int i = 0; i < 100'000; ++i) objects += "{\"a\":";
  EXPECT_EQ(parse_rays(objects).substr(0, 8), "too_deep");
}

TEST(MalformedJson, options_of_lists_and_counts_are_422_with_the_place) {
  const std::vector<Case> lists{
      {rays_with(R"(,"max_hits":0)"), "out_of_range 422 /max_hits"},
      {rays_with(R"(,"max_hits":65537)"), "out_of_range 422 /max_hits"},
      {rays_with(R"(,"max_hits":1.5)"), "wrong_type 422 /max_hits"},
      {rays_with(R"(,"after":null)"), "wrong_type 422 /after"},
      {rays_with(R"(,"after":[])"), "wrong_length 422 /after"},
      {rays_with(R"(,"after":[null,null])"), "wrong_length 422 /after"},
      {rays_with(R"(,"after":[5])"), "wrong_type 422 /after/0"},
      {rays_with(R"(,"after":[[1,2]])"), "wrong_length 422 /after/0"},
      {rays_with(R"(,"after":[[1,2,3,4]])"), "wrong_length 422 /after/0"},
      {rays_with(R"(,"after":[[null,2,3]])"), "wrong_type 422 /after/0/0"},
      {rays_with(R"(,"after":[[1e999,2,3]])"), "out_of_range 422 /after/0/0"},
      {rays_with(R"(,"after":[[1,-2,3]])"), "out_of_range 422 /after/0/1"},
      {rays_with(R"(,"after":[[1,2,4294967295]])"), "out_of_range 422 /after/0/2"},
  };
  const auto parse = [](const std::string& body, RayQuestion question) {
    return outcome(parse_ray_request("application/json", body, {}, Limits{}, question));
  };
  for (const Case& c : lists) EXPECT_EQ(parse(c.body, RayQuestion::kAll), c.expected) << c.body;
  EXPECT_EQ(parse(rays_with(R"(,"max_hits":7,"after":[null])"), RayQuestion::kAll), "ok");
  for (const RayQuestion other : {RayQuestion::kClosest, RayQuestion::kAny, RayQuestion::kCount}) {
    EXPECT_EQ(parse(rays_with(R"(,"max_hits":7)"), other), "unknown_field 422 /max_hits");
    EXPECT_EQ(parse(rays_with(R"(,"after":[null])"), other), "unknown_field 422 /after");
  }
  EXPECT_EQ(parse(rays_with(R"(,"precision":"fast")"), RayQuestion::kCount), "invalid_value 422 /precision");
  EXPECT_EQ(parse(rays_with(R"(,"precision":"robust")"), RayQuestion::kCount), "ok");
  EXPECT_EQ(outcome(parse_ray_request("application/json", rays_with(""), {{"precision", "fast"}}, Limits{},
                                      RayQuestion::kCount)),
            "invalid_value 422 ?precision");
}

TEST(MalformedJson, points_of_the_wrong_shape_are_422_with_the_place) {
  const std::vector<Case> cases{
      {"[]", "wrong_type 422 "},
      {"{}", "missing_field 422 /points"},
      {R"({"points":null})", "wrong_type 422 /points"},
      {R"({"points":[1,2,3]})", "wrong_type 422 /points/0"},
      {R"({"points":[[1,2]]})", "wrong_length 422 /points/0"},
      {R"({"points":[[0,0,0],[1,2,"3"]]})", "wrong_type 422 /points/1/2"},
      {R"({"points":[],"max_distance":-1})", "out_of_range 422 /max_distance"},
      {R"({"points":[],"max_distance":"1"})", "wrong_type 422 /max_distance"},
      {R"({"points":[],"deadline_ms":0})", "out_of_range 422 /deadline_ms"},
      {R"({"points":[],"origins":[]})", "unknown_field 422 /origins"},
      {R"({"points":[],"max_distance":null})", "ok"},
      {R"({"points":[],"max_distance":0})", "ok"},
  };
  const auto parse = [](const std::string& body, PointQuestion question) {
    return outcome(parse_point_request("application/json", body, {}, Limits{}, question));
  };
  for (const Case& c : cases) EXPECT_EQ(parse(c.body, PointQuestion::kClosest), c.expected) << c.body;
  EXPECT_EQ(parse(R"({"points":[],"max_distance":1})", PointQuestion::kInside),
            "unknown_field 422 /max_distance");
  Limits few;
  few.json_rays = few.binary_rays = 1;
  EXPECT_EQ(outcome(parse_point_request("application/json", R"({"points":[[0,0,0],[0,0,0]]})", {}, few,
                                        PointQuestion::kInside)),
            "too_many_points 413 /points");
  const std::string binary = "application/vnd.gridcast.points; dtype=float32";
  EXPECT_EQ(outcome(parse_point_request(binary, std::string(24, '\0'), {}, few, PointQuestion::kInside)),
            "too_many_points 413 ");
  EXPECT_EQ(outcome(parse_point_request(binary, std::string(13, '\0'), {}, Limits{}, PointQuestion::kInside)),
            "wrong_length 422 ");
}

TEST(MalformedJson, rays_of_the_wrong_shape_are_422_with_the_place) {
  const std::vector<Case> cases{
      {"[]", "wrong_type 422 "},
      {"null", "wrong_type 422 "},
      {"3", "wrong_type 422 "},
      {"\"x\"", "wrong_type 422 "},
      {"{}", "missing_field 422 /origins"},
      {R"({"origins":[]})", "missing_field 422 /directions"},
      {R"({"directions":[]})", "missing_field 422 /origins"},
      {R"({"origins":null,"directions":[]})", "wrong_type 422 /origins"},
      {R"({"origins":{},"directions":[]})", "wrong_type 422 /origins"},
      {R"({"origins":[0,0,5],"directions":[[0,0,1]]})", "wrong_type 422 /origins/0"},
      {R"({"origins":[0],"directions":[[0,0,1]]})", "wrong_type 422 /origins/0"},
      {R"({"origins":[[0,0]],"directions":[[0,0,1]]})", "wrong_length 422 /origins/0"},
      {R"({"origins":[[0,0,0,0]],"directions":[[0,0,1]]})", "wrong_length 422 /origins/0"},
      {R"({"origins":[[0,0,"5"]],"directions":[[0,0,1]]})", "wrong_type 422 /origins/0/2"},
      {R"({"origins":[[0,0,null]],"directions":[[0,0,1]]})", "wrong_type 422 /origins/0/2"},
      {R"({"origins":[[0,0,true]],"directions":[[0,0,1]]})", "wrong_type 422 /origins/0/2"},
      {R"({"origins":[[0,0,5],[0,0,5]],"directions":[[0,0,1]]})", "wrong_length 422 /directions"},
      {R"({"origins":[[0,0,5]],"directions":[[0,0,1],[0,0,[]]]})", "wrong_length 422 /directions"},
      {R"({"origins":[[0,0,5]],"directions":[[0,0,[]]]})", "wrong_type 422 /directions/0/2"},
      {rays_with(R"(,"tnear":[])"), "wrong_length 422 /tnear"},
      {rays_with(R"(,"tnear":0)"), "wrong_type 422 /tnear"},
      {rays_with(R"(,"tnear":["0"])"), "wrong_type 422 /tnear/0"},
      {rays_with(R"(,"tfar":[1,2])"), "wrong_length 422 /tfar"},
      {rays_with(R"(,"tfar":[[1]])"), "wrong_type 422 /tfar/0"},
      {rays_with(R"(,"exclude":[])"), "wrong_length 422 /exclude"},
      {rays_with(R"(,"exclude":[3])"), "wrong_type 422 /exclude/0"},
      {rays_with(R"(,"exclude":[[3]])"), "wrong_length 422 /exclude/0"},
      {rays_with(R"(,"exclude":[[1,2,3]])"), "wrong_length 422 /exclude/0"},
      {rays_with(R"(,"exclude":[[-1,2]])"), "out_of_range 422 /exclude/0/0"},
      {rays_with(R"(,"exclude":[[1,4294967295]])"), "out_of_range 422 /exclude/0/1"},
      {rays_with(R"(,"exclude":[[1,0.5]])"), "wrong_type 422 /exclude/0/1"},
      {rays_with(R"(,"precision":"exactly")"), "invalid_value 422 /precision"},
      {rays_with(R"(,"precision":1)"), "wrong_type 422 /precision"},
      {rays_with(R"(,"fields":"uv")"), "wrong_type 422 /fields"},
      {rays_with(R"(,"fields":["uv","w"])"), "invalid_value 422 /fields/1"},
      {rays_with(R"(,"stats":1)"), "wrong_type 422 /stats"},
      {rays_with(R"(,"deadline_ms":0)"), "out_of_range 422 /deadline_ms"},
      {rays_with(R"(,"deadline_ms":-1)"), "out_of_range 422 /deadline_ms"},
      {rays_with(R"(,"deadline_ms":30001)"), "out_of_range 422 /deadline_ms"},
      {rays_with(R"(,"masks":1)"), "unknown_field 422 /masks"},
      {rays_with(R"(,"":1)"), "unknown_field 422 /"},
      {rays_with(R"(,"a/b~c":1)"), "unknown_field 422 /a~1b~0c"},
      {rays_with(R"(,"Origins":[])"), "unknown_field 422 /Origins"},
      {rays_with(R"(,"tfar":[1],"tfar":[2])"), "duplicate_field 400 /tfar"},
      {rays_with(R"(,"or\u0069gins":[])"), "duplicate_field 400 /origins"},
  };
  for (const Case& c : cases) EXPECT_EQ(parse_rays(c.body), c.expected) << c.body;
}

TEST(MalformedJson, a_long_unknown_member_is_cut_in_the_pointer) {
  const std::string outcome = parse_rays("{\"" + std::string(100'000, 'k') + "\":1}");
  EXPECT_EQ(outcome, "unknown_field 422 /" + std::string(64, 'k'));
}

TEST(MalformedJson, transactions_name_the_edit_and_the_place_in_it) {
  Limits limits;
  limits.transaction_edits = 2;
  const std::string identity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0]]";
  const std::string fine = R"({"op":"remove_instance","instance_id":1})";
  const auto second = [&](const std::string& edit) { return "{\"edits\":[" + fine + "," + edit + "]}"; };
  const std::vector<Case> cases{
      {"{}", "missing_field 422 /edits"},
      {R"({"edits":{}})", "wrong_type 422 /edits"},
      {R"({"edits":[]})", "out_of_range 422 /edits"},
      {"{\"edits\":[" + fine + "," + fine + "," + fine + "]}", "out_of_range 422 /edits"},
      {second("3"), "wrong_type 422 /edits/1"},
      {second("{}"), "missing_field 422 /edits/1/op"},
      {second(R"({"op":3})"), "wrong_type 422 /edits/1/op"},
      {second(R"({"op":"grow"})"), "invalid_value 422 /edits/1/op"},
      {second(R"({"op":"remove_instance","op":"remove_instance","instance_id":1})"),
       "duplicate_field 400 /edits/1/op"},
      {second(R"({"op":"remove_instance"})"), "missing_field 422 /edits/1/instance_id"},
      {second(R"({"op":"remove_instance","instance_id":4294967295})"),
       "out_of_range 422 /edits/1/instance_id"},
      {second(R"({"op":"remove_instance","instance_id":1,"transform":)" + identity + "}"),
       "unknown_field 422 /edits/1/transform"},
      {second(R"({"op":"move_instance","instance_id":1})"), "missing_field 422 /edits/1/transform"},
      {second(R"({"op":"move_instance","instance_id":1,"mask":3})"), "unknown_field 422 /edits/1/mask"},
      {second(R"({"op":"change_instance","instance_id":1})"), "missing_field 422 /edits/1"},
      {second(R"({"op":"change_instance","mask":1})"), "missing_field 422 /edits/1/instance_id"},
      {second(R"({"op":"change_instance","instance_id":1,"mask":256})"), "out_of_range 422 /edits/1/mask"},
      {second(R"({"op":"change_instance","instance_id":1,"mask":0})"), "ok"},
      {second(R"({"op":"add_instance","mesh_id":1,"mask":-1})"), "out_of_range 422 /edits/1/mask"},
      {second(R"({"op":"move_instance","instance_id":1,"transform":[[1,0,0,0],[0,1,0],[0,0,1,0]]})"),
       "wrong_length 422 /edits/1/transform/1"},
      {second(R"({"op":"add_instance"})"), "missing_field 422 /edits/1/mesh_id"},
      {second(R"({"op":"add_instance","mesh_id":0,"name":"\n"})"), "invalid_value 422 /edits/1/name"},
      {second(R"({"op":"replace_vertices","mesh_id":0})"), "missing_field 422 /edits/1/positions"},
      {second(R"({"op":"replace_vertices","mesh_id":0,"positions":[]})"),
       "wrong_length 422 /edits/1/positions"},
      {second(R"({"op":"replace_vertices","mesh_id":0,"positions":[[0,0,1e39]]})"),
       "out_of_range 422 /edits/1/positions/0"},
      {second(R"({"op":"replace_vertices","mesh_id":0,"positions":[[0,0,1]],"vertex_ids":[1,2]})"),
       "wrong_length 422 /edits/1/vertex_ids"},
      {second(R"({"op":"replace_vertices","mesh_id":0,"positions":[[0,0,1]],"update":"now"})"),
       "invalid_value 422 /edits/1/update"},
      {second(R"({"op":"add_instance","mesh_id":0,"transform":)" + identity + R"(,"name":"x"})"), "ok"},
  };
  for (const Case& c : cases) EXPECT_EQ(outcome(parse_transaction(c.body, limits)), c.expected) << c.body;
}

TEST(MalformedJson, instances_and_scenes_are_checked_to_the_last_number) {
  const Limits limits;
  const std::string identity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0]]";
  const std::vector<Case> moves{
      {"{}", "missing_field 422 /moves"},
      {R"({"moves":{}})", "wrong_type 422 /moves"},
      {R"({"moves":[3]})", "wrong_type 422 /moves/0"},
      {R"({"moves":[{}]})", "missing_field 422 /moves/0/instance_id"},
      {R"({"moves":[{"instance_id":1}]})", "missing_field 422 /moves/0"},
      {R"({"moves":[{"instance_id":-1,"transform":)" + identity + "}]}",
       "out_of_range 422 /moves/0/instance_id"},
      {R"({"moves":[{"instance_id":1.5,"transform":)" + identity + "}]}",
       "wrong_type 422 /moves/0/instance_id"},
      {R"({"moves":[{"instance_id":1,"transform":[1,0,0,0]}]})", "wrong_type 422 /moves/0/transform/0"},
      {R"({"moves":[{"instance_id":1,"transform":[[1,0,0,0],[0,1,0,0]]}]})",
       "wrong_length 422 /moves/0/transform"},
      {R"({"moves":[{"instance_id":1,"transform":[[1,0,0,0],[0,1,0],[0,0,1,0]]}]})",
       "wrong_length 422 /moves/0/transform/1"},
      {R"({"moves":[{"instance_id":1,"transform":[[1,0,0,0],[0,1,0,"0"],[0,0,1,0]]}]})",
       "wrong_type 422 /moves/0/transform/1/3"},
      {R"({"moves":[{"instance_id":1,"transform":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]}]})",
       "invalid_value 422 /moves/0/transform/3"},
      {R"({"moves":[{"instance_id":1,"transform":)" + identity + R"(},{"instance_id":1,"transform":)" +
           identity + "}]}",
       "duplicate_id 422 /moves/1/instance_id"},
      {R"({"moves":[{"instance_id":1,"mask":256,"transform":)" + identity + "}]}",
       "out_of_range 422 /moves/0/mask"},
      {R"({"moves":[{"instance_id":1,"mesh_id":2,"transform":)" + identity + "}]}",
       "unknown_field 422 /moves/0/mesh_id"},
      {R"({"moves":[{"instance_id":1,"mask":0},{"instance_id":1,"name":"a"}]})",
       "duplicate_id 422 /moves/1/instance_id"},
      {R"({"moves":[{"instance_id":1,"mask":0},{"instance_id":2,"name":"a"}]})", "ok"},
      {R"({"moves":[{"instance_id":1,"transform":)" + identity + "}]}", "ok"},
      {R"({"moves":[]})", "ok"},
  };
  for (const Case& c : moves)
    EXPECT_EQ(outcome(parse_move_instances("application/json", c.body, limits)), c.expected) << c.body;
  const std::vector<Case> adds{
      {"{}", "missing_field 422 /mesh_id"},
      {R"({"mesh_id":4294967295})", "out_of_range 422 /mesh_id"},
      {R"({"mesh_id":1e300})", "out_of_range 422 /mesh_id"},
      {R"({"mesh_id":"0"})", "wrong_type 422 /mesh_id"},
      {R"({"mesh_id":0,"name":3})", "wrong_type 422 /name"},
      {R"({"mesh_id":0,"name":"a\nb"})", "invalid_value 422 /name"},
      {R"({"mesh_id":0,"name":")" + std::string(257, 'n') + "\"}", "invalid_value 422 /name"},
      {R"({"mesh_id":0,"name":")" + std::string(256, 'n') + "\"}", "ok"},
      {R"({"mesh_id":2.0})", "ok"},
      {R"({"mesh_id":2,"mask":256})", "out_of_range 422 /mask"},
      {R"({"mesh_id":2,"mask":[1]})", "wrong_type 422 /mask"},
  };
  for (const Case& c : adds) EXPECT_EQ(outcome(parse_add_instance(c.body, limits)), c.expected) << c.body;
  const std::vector<Case> scenes{
      {"{}", "missing_field 422 /name"},
      {R"({"name":""})", "invalid_value 422 /name"},
      {R"({"name":".."})", "invalid_value 422 /name"},
      {R"({"name":"a/b"})", "invalid_value 422 /name"},
      {R"({"name":null})", "wrong_type 422 /name"},
      {R"({"name":"lab_1.x-y"})", "ok"},
  };
  for (const Case& c : scenes) EXPECT_EQ(outcome(parse_empty_scene(c.body, limits)), c.expected) << c.body;
}

TEST(MalformedJson, vertices_are_finite_as_floats) {
  const auto parse = [](const std::string& body) {
    return outcome(parse_vertex_request("application/json", body, {}, Limits{}));
  };
  const std::vector<Case> cases{
      {"{}", "missing_field 422 /positions"},
      {R"({"positions":[]})", "wrong_length 422 /positions"},
      {R"({"positions":[[1,2]]})", "wrong_length 422 /positions/0"},
      {R"({"positions":[[0,0,0],[1e39,0,0]]})", "out_of_range 422 /positions/1"},
      {R"({"positions":[[3e38,0,0]]})", "ok"},
      {R"({"positions":[[1,2,3]],"vertex_ids":[]})", "wrong_length 422 /vertex_ids"},
      {R"({"positions":[[1,2,3]],"vertex_ids":[1,2]})", "wrong_length 422 /vertex_ids"},
      {R"({"positions":[[1,2,3]],"vertex_ids":[-2]})", "out_of_range 422 /vertex_ids/0"},
      {R"({"positions":[[1,2,3]],"update":"now"})", "invalid_value 422 /update"},
      {R"({"positions":[[1,2,3]],"normals":[]})", "unknown_field 422 /normals"},
  };
  for (const Case& c : cases) EXPECT_EQ(parse(c.body), c.expected) << c.body;
}

TEST(MalformedJson, render_settings_are_checked_one_by_one_and_together) {
  const auto parse = [](const std::string& body, const std::string& accept = "*/*") {
    return outcome(parse_render_request(body, accept, Limits{}));
  };
  const std::vector<Case> cases{
      {"{}", "ok"},
      {"[]", "wrong_type 422 "},
      {R"({"camera":"best"})", "invalid_value 422 /camera"},
      {R"({"camera":true})", "wrong_type 422 /camera"},
      {R"({"camera":-1})", "out_of_range 422 /camera"},
      {R"({"camera":0.5})", "wrong_type 422 /camera"},
      {R"({"camera":{"eye":[0,0,1]}})", "missing_field 422 /camera/target"},
      {R"({"camera":{"eye":[0,1],"target":[0,0,0]}})", "wrong_length 422 /camera/eye"},
      {R"({"camera":{"eye":[0,0,1],"target":[0,0,0],"yfov_deg":180}})", "out_of_range 422 /camera/yfov_deg"},
      {R"({"camera":{"eye":[0,0,1],"target":[0,0,0],"yfov_deg":0}})", "out_of_range 422 /camera/yfov_deg"},
      {R"({"camera":{"eye":[0,0,1],"target":[0,0,0],"fov":40}})", "unknown_field 422 /camera/fov"},
      {R"({"width_px":0})", "out_of_range 422 /width_px"},
      {R"({"width_px":8193})", "out_of_range 422 /width_px"},
      {R"({"width_px":-1})", "out_of_range 422 /width_px"},
      {R"({"height_px":"480"})", "wrong_type 422 /height_px"},
      {R"({"samples":4097})", "out_of_range 422 /samples"},
      {R"({"max_depth":65})", "out_of_range 422 /max_depth"},
      {R"({"integrator":"path"})", "invalid_value 422 /integrator"},
      {R"({"layers":["depth"]})", "out_of_range 422 /layers"},
      {R"({"format":"exr","layers":["depth","depth"]})", "duplicate_id 422 /layers/1"},
      {R"({"format":"exr","layers":["depth","albedo"]})", "invalid_value 422 /layers/1"},
      {R"({"format":"exr","layers":["depth","normal"]})", "ok"},
      {R"({"format":"jpeg"})", "invalid_value 422 /format"},
      {R"({"width_px":8192,"height_px":8192,"samples":8})", "ok"},
      {R"({"width_px":8192,"height_px":8192,"samples":9})", "out_of_range 422 /samples"},
  };
  for (const Case& c : cases) EXPECT_EQ(parse(c.body), c.expected) << c.body;
  EXPECT_EQ(parse("{}", "text/html"), "not_acceptable 406 Accept");
  EXPECT_EQ(parse(R"({"format":"exr"})", "image/png"), "not_acceptable 406 Accept");
}

}  // namespace
}  // namespace gridcast::proto
