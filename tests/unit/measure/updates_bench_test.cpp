#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "core/measure/bench.h"
#include "core/measure/embree_yardstick.h"

namespace gridcast::measure {
namespace {

BenchOptions tiny_options() {
  BenchOptions options;
  options.rays = 200;
  options.repeat = 2;
  return options;
}

TEST(BuildsBench, TreesOfBothEnginesAreTimedAndWeighed) {
  Report report;
  ASSERT_TRUE(bench_builds(make_scene("S2", 1, 0.01).value(), tiny_options(), report, {}));
  std::set<std::string> names;
  for (const BuildRow& row : report.build) {
    SCOPED_TRACE(row.engine + " " + row.structure);
    names.insert(row.structure);
    EXPECT_GT(row.ms, 0.0);
    EXPECT_GT(row.bytes_per_triangle, 4.0);
    EXPECT_LT(row.bytes_per_triangle, 2000.0);
    EXPECT_GT(row.vs_embree_medium, 0.0);
    EXPECT_GT(row.vs_embree_low, 0.0);
  }
  EXPECT_EQ(names, (std::set<std::string>{"low", "medium", "medium_compact", "robust", "high", "wide_bvh",
                                          "wide_bvh_whole", "wide_bvh_fast", "bvh", "bvh_fast", "kd_tree"}));
}

TEST(RefitsBench, StructuresThatCannotRefitAreLeftOut) {
  Report report;
  ASSERT_TRUE(bench_refits(make_scene("S1", 1, 0.01).value(), tiny_options(), report, {}));
  std::set<std::string> names;
  for (const RefitRow& row : report.refit) names.insert(row.structure);
  EXPECT_EQ(names, (std::set<std::string>{"refit", "wide_bvh", "bvh"}));
  EXPECT_EQ(report.refit.front().vs_embree_refit, 1.0);
}

TEST(InstancesBench, AllAndOneInAHundredAreMoved) {
  Report report;
  ASSERT_TRUE(bench_instances(make_scene("I3", 1, 0.05).value(), tiny_options(), report, {}));
  std::multiset<std::string> updates;
  for (const InstanceRow& row : report.instances) {
    updates.insert(row.update);
    EXPECT_EQ(row.instances, 500U);
    EXPECT_EQ(row.moved, row.update == "one_percent_moved" ? 5U : 500U);
    EXPECT_GT(row.ns_per_moved, 0.0);
    EXPECT_GT(row.bytes_per_instance, 0.0);
  }
  EXPECT_EQ(updates, (std::multiset<std::string>{"all_moved", "all_moved", "all_moved",
                                                 "all_moved_and_looked_at", "build", "one_percent_moved",
                                                 "one_percent_moved", "one_percent_moved"}));
}

TEST(InstancesBench, ASingleMeshHasNothingToMove) {
  Report report;
  ASSERT_TRUE(bench_instances(make_scene("S1", 1, 0.01).value(), tiny_options(), report, {}));
  EXPECT_TRUE(report.instances.empty());
}

TEST(EmbreeYardstick, BuildingStopsWhenTold) {
  for (const char* name : {"S1", "I3"}) {
    const scene::SceneData data = make_scene(name, 1, 0.01).value().data;
    std::stop_source stop;
    EXPECT_TRUE(EmbreeScene::build(data, {}, stop.get_token())) << name;
    stop.request_stop();
    const auto stopped = EmbreeScene::build(data, {}, stop.get_token());
    ASSERT_FALSE(stopped) << name;
    EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled) << name;
  }
}

TEST(EmbreeYardstick, MovedVerticesAndInstancesAreSeenByRays) {
  const RaySet down{RaySetKind::kPrimary, {{0.F, 50.F, 0.F, 0.F, 0.F, -1.F, 0.F, 1e9F}}};
  EmbreeAnswers answers(1);
  const auto t_of = [&](const EmbreeScene& scene, EmbreeEntry entry) {
    scene.trace(down.rows, 0, 1, QueryKind::kClosest, entry, answers);
    return answers.hit[0] != 0 ? double(answers.t[0]) : -1.0;
  };
  scene::SceneData data;
  mesh::TriangleMesh floor;
  floor.positions = {{-9, 0, -9}, {9, 0, -9}, {0, 0, 9}};
  floor.triangles = {{0, 1, 2}};
  data.meshes = {std::make_shared<const mesh::TriangleMesh>(floor)};
  data.instances.push_back({.name = {}, .world_from_object = {}, .mesh_id = 0});
  auto single = EmbreeScene::build(data, {.use = EmbreeUse::kDynamic}).value();
  for (Vec3f& p : floor.positions) p.y = 10.F;
  EXPECT_FLOAT_EQ(float(t_of(*single, EmbreeEntry::kSingle)), 50.F);
  ASSERT_TRUE(single->refit(floor.positions));
  for (const EmbreeEntry entry :
       {EmbreeEntry::kSingle, EmbreeEntry::kPacket8, EmbreeEntry::kPacket16, EmbreeEntry::kPacket16Coherent})
    EXPECT_FLOAT_EQ(float(t_of(*single, entry)), 40.F) << to_string(entry);
  EXPECT_FALSE(single->refit(std::vector<Vec3f>(7)));

  data.instances.push_back(data.instances[0]);
  data.instances[1].world_from_object.translation = {100.0, 0.0, 0.0};
  auto placed = EmbreeScene::build(data, {.use = EmbreeUse::kDynamic}).value();
  EXPECT_FLOAT_EQ(float(t_of(*placed, EmbreeEntry::kSingle)), 50.F);
  EXPECT_EQ(answers.instance_id[0], 0U);
  const EmbreeScene::Move moves[] = {{0, {Mat3d(1.0), {-100.0, 0.0, 0.0}}},
                                     {1, {Mat3d(1.0), {0.0, 20.0, 0.0}}}};
  ASSERT_TRUE(placed->move_instances(moves));
  EXPECT_FLOAT_EQ(float(t_of(*placed, EmbreeEntry::kSingle)), 30.F);
  EXPECT_EQ(answers.instance_id[0], 1U);
}

TEST(EmbreeYardstick, SaysWhichEmbreeItIs) {
  const EmbreeInfo info = embree_info();
  EXPECT_TRUE(info.version.starts_with("3.") || info.version.starts_with("4.")) << info.version;
  EXPECT_TRUE(info.assertions == "yes" || info.assertions == "no") << info.assertions;
}

}  // namespace
}  // namespace gridcast::measure
