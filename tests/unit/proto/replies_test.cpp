#include "proto/replies.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/openapi.h"

namespace gridcast::proto {
namespace {

using Json = nlohmann::json;

/// Members of a reply against those that the contract requires (all are required where the reply has them).
void expect_members(const std::string& text, const std::string& schema_name) {
  const Json contract = Json::parse(openapi_json());
  const Json& schema = contract.at("components").at("schemas").at(schema_name);
  const Json reply = Json::parse(text);
  for (const Json& name : schema.at("required"))
    EXPECT_TRUE(reply.contains(name.get<std::string>())) << schema_name << " lacks " << name;
  for (const auto& [name, value] : reply.items())
    EXPECT_TRUE(schema.at("properties").contains(name)) << schema_name << " has no " << name;
}

TEST(Replies, members_are_those_of_the_contract) {
  SceneInfo scene;
  scene.kept = SceneInfo::Kept{3, 7, 2};
  EXPECT_EQ(Json::parse(to_json(scene))["kept_versions"], Json({{"oldest", "3"}, {"newest", "7"}}));
  expect_members(to_json(ServiceInfo()), "Service");
  expect_members(to_json(scene), "Scene");
  expect_members(to_json(std::vector<SceneInfo>{scene}), "SceneList");
  MeshInfo mesh;
  expect_members(to_json(std::vector<MeshInfo>{mesh}, 3), "MeshList");
  EXPECT_FALSE(Json::parse(to_json(std::vector<MeshInfo>{mesh}, 3))["meshes"][0].contains("topology"));
  mesh.topology = MeshInfo::Topology();
  expect_members(to_json(mesh, 3), "MeshReply");
  expect_members(Json::parse(to_json(mesh, 3)).at("structure").dump(), "MeshStructure");
  expect_members(Json::parse(to_json(mesh, 3)).at("topology").dump(), "Topology");
  expect_members(to_json(InstanceInfo(), 3), "InstanceReply");
  InstanceList list;
  list.instances.emplace_back();
  expect_members(to_json(list), "InstanceList");
  expect_members(to_json(StructureInfo()), "Structure");
  expect_members(to_json(VertexReply()), "VertexReply");
  expect_members(to_json(MovesReply()), "MovesReply");
  expect_members(health_json("live"), "Health");
}

TEST(Replies, empty_lists_are_lists_and_empty_boxes_null) {
  EXPECT_EQ(to_json(std::vector<SceneInfo>{}), R"({"scenes":[]})");
  EXPECT_EQ(to_json(InstanceList()), R"({"scene_version":"0","total":0,"instances":[],"next_offset":null})");
  EXPECT_TRUE(Json::parse(to_json(SceneInfo()))["bounds"].is_null());
  const Json structure = Json::parse(to_json(MeshInfo(), 3)).at("structure");
  EXPECT_TRUE(structure.at("looseness").is_null() && structure.at("looseness_at_build").is_null());
  EXPECT_TRUE(structure.at("steps_per_ray").is_null());
  EXPECT_EQ(health_json("live"), R"({"status":"live"})");
  EXPECT_EQ(Json::parse(to_json(SceneInfo()))["warnings"], Json::array());
}

TEST(Replies, a_transform_is_written_as_it_is_read) {
  InstanceInfo info;
  info.instance_id = 4;
  info.mesh_id = 1;
  info.name = "\xFF";  // not UTF-8
  info.world_from_object.linear = Mat3d(1, 5, 9, 2, 6, 10, 3, 7, 11);
  info.world_from_object.translation = {4, 8, 12};
  info.bounds = {{0, 0, 0}, {1, 2, 3}};
  info.mask = 6;
  EXPECT_EQ(to_json(info, 7),
            "{\"scene_version\":\"7\",\"instance_id\":4,\"mesh_id\":1,\"name\":\"\xEF\xBF\xBD\","
            "\"transform\":[[1.0,2.0,3.0,4.0],[5.0,6.0,7.0,8.0],[9.0,10.0,11.0,12.0]],"
            "\"bounds\":{\"lower\":[0.0,0.0,0.0],\"upper\":[1.0,2.0,3.0]},\"active\":true,\"mask\":6}");
}

TEST(Replies, the_service_says_its_vocabulary_and_limits) {
  const Json json = Json::parse(to_json(ServiceInfo{"0.1.0", "avx2", 2, Limits{}}));
  EXPECT_EQ(json["structures"][0], "auto");
  EXPECT_EQ(json["ray_media_types"], (Json{"application/json", "application/vnd.gridcast.rays"}));
  EXPECT_EQ(json["limits"]["json_bytes"], 16 << 20);
}

}  // namespace
}  // namespace gridcast::proto
