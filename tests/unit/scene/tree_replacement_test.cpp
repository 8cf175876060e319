#include "core/scene/tree_replacement.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "core/scene/flatten.h"
#include "core/scene/scene_state.h"
#include "core/scene/tree_watch.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

using blas::BuildQuality;
using blas::StructureKind;

constexpr UpdateOptions kServed{RebuildPlace::kInBackground};

std::shared_ptr<const Scene> scene_of(int level, StructureKind kind = StructureKind::kAuto) {
  SceneData data;
  data.meshes = {test::share(test::jittered_icosphere(level, 5))};
  data.deformations.resize(1);
  place(data, 0, {});
  SceneBuildOptions options;
  options.blas.kind = kind;
  return built(std::move(data), options);
}
/// More triangles than are rebuilt within an update.
std::shared_ptr<const Scene> large_scene(StructureKind kind = StructureKind::kAuto) {
  return scene_of(5, kind);
}

using Positions = std::vector<Vec3f>;

Positions shuffled(Positions positions, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::shuffle(positions.begin(), positions.end(), engine);
  return positions;
}
Positions twisted(Positions positions, double turns) {
  for (Vec3f& p : positions) {
    const double angle = 6.283185307 * turns * p.y, c = std::cos(angle), s = std::sin(angle);
    p = {float(c * p.x - s * p.z), p.y, float(s * p.x + c * p.z)};
  }
  return positions;
}
Positions exploded(Positions positions, double far, std::uint64_t seed) {
  test::Random random(seed);
  for (Vec3f& p : positions) p += Vec3f(far * random.direction());
  return positions;
}

/// Vertices so far from where they were that the tree is of no use, and so near that boxes do not crowd.
Positions scattered(Positions positions) {
  return exploded(std::move(positions), 0.3, 3);
}

UpdateResult moved(const Scene& scene, Positions positions, UpdateMode mode = UpdateMode::kAuto,
                   const UpdateOptions& options = kServed) {
  return apply_update(scene, {ReplaceVertices{0, std::move(positions), {}, mode}}, options).value();
}
const Positions& positions_of(const Scene& scene) {
  return scene.blas(0).mesh().positions;
}
/// The wide BVH of a scene that begins with these vertices.
blas::Blas fresh_tree(const Scene& scene) {
  blas::BuildOptions options = scene.blas_options();
  options.kind = StructureKind::kWideBvh;
  return blas::Blas::build(scene.blas(0).mesh_ptr(), options).value();
}
blas::Blas tree_of(const TreeOrder& order) {
  return blas::Blas::build(order.mesh, order.options).value();
}
/// Empty where the tree was refused.
std::shared_ptr<const Scene> replaced(const Scene& scene, const blas::Blas& tree) {
  auto outcome = replace_tree(scene, 0, tree).value();
  const auto* next = std::get_if<std::shared_ptr<const Scene>>(&outcome);
  return next != nullptr ? *next : nullptr;
}
std::optional<TreeRefusal> refusal(const Scene& scene, std::uint32_t mesh_id, const blas::Blas& tree) {
  auto outcome = replace_tree(scene, mesh_id, tree).value();
  const auto* refused = std::get_if<TreeRefusal>(&outcome);
  return refused != nullptr ? std::optional(*refused) : std::nullopt;
}
void expect_same_answers(const Scene& a, const Scene& b, int rays, std::uint64_t seed) {
  test::Random random(seed);
  for (int i = 0; i < rays; ++i) {
    const Ray ray = random_ray(a, random);
    ASSERT_TRUE(same(intersect(a, ray), intersect(b, ray)));
  }
}

TEST(TreeReplacement, nothing_is_ordered_for_a_good_tree_or_a_small_mesh) {
  const auto scene = large_scene();
  EXPECT_FALSE(better_tree(*scene, 0));
  EXPECT_FALSE(better_tree(*scene, 1)) << "there is no such mesh";
  const auto nudged = moved(*scene, twisted(positions_of(*scene), 0.001));
  EXPECT_FALSE(better_tree(*nudged.scene, 0));
  EXPECT_TRUE(wanted_trees(nudged.report).empty());
  const auto small = scene_of(3);
  const auto mess = moved(*small, shuffled(positions_of(*small), 3));
  EXPECT_EQ(mess.report.meshes[0].action, MeshAction::kRebuild);
  EXPECT_EQ(mess.scene->blas(0).options().quality, BuildQuality::kDefault);
  EXPECT_FALSE(better_tree(*mess.scene, 0));
}

TEST(TreeReplacement, a_worse_tree_serves_while_a_better_one_is_ordered) {
  const auto scene = large_scene();
  const Positions bent = twisted(positions_of(*scene), 0.15);
  const auto twist = moved(*scene, bent);
  const MeshUpdateReport& report = twist.report.meshes[0];
  EXPECT_EQ(report.action, MeshAction::kRefit) << report.reason;
  EXPECT_NE(report.reason.find("A better tree is being built."), std::string::npos) << report.reason;
  EXPECT_EQ(wanted_trees(twist.report), std::vector<std::uint32_t>{0});
  ASSERT_TRUE(better_tree(*twist.scene, 0));
  // Nothing is ordered where nobody builds in the background, nor by whoever asks for a refit.
  EXPECT_TRUE(wanted_trees(moved(*scene, bent, UpdateMode::kAuto, {}).report).empty());
  const auto refitted = moved(*scene, bent, UpdateMode::kRefit);
  EXPECT_TRUE(wanted_trees(refitted.report).empty());
}

TEST(TreeReplacement, a_useless_tree_is_rebuilt_in_the_update_and_a_better_one_ordered) {
  const auto scene = large_scene();
  const auto mess = moved(*scene, scattered(positions_of(*scene)));
  EXPECT_EQ(mess.report.meshes[0].action, MeshAction::kRebuild);
  EXPECT_EQ(mess.scene->blas(0).options().quality, BuildQuality::kFast);
  EXPECT_NE(reason_of(mess.scene->blas(0), BuildQuality::kDefault).find("Morton"), std::string::npos);
  const auto order = better_tree(*mess.scene, 0);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->options.quality, BuildQuality::kDefault);
  EXPECT_EQ(order->mesh, mess.scene->blas(0).mesh_ptr());

  const auto better = replaced(*mess.scene, tree_of(*order));
  ASSERT_NE(better, nullptr);
  EXPECT_EQ(better->version(), mess.scene->version());
  EXPECT_LT(better->blas(0).stats().cost, mess.scene->blas(0).stats().cost);
  EXPECT_FALSE(better_tree(*better, 0));
  EXPECT_TRUE(better->validate().ok());
  expect_same_answers(*mess.scene, *better, 300, 4);
  const SceneDelta delta = difference(*mess.scene, *better);
  EXPECT_TRUE(delta.meshes.empty() && delta.instances.empty() && !delta.pose) << "nothing to be stored";
}

/// Where boxes crowd, the update makes the tree that a scene with these vertices begins with.
TEST(TreeReplacement, a_crowded_mesh_gets_its_final_tree_in_the_update) {
  const auto scene = large_scene();
  for (const UpdateOptions& options : {kServed, UpdateOptions{}}) {
    const auto mess = moved(*scene, shuffled(positions_of(*scene), 3), UpdateMode::kAuto, options);
    EXPECT_EQ(mess.report.meshes[0].action, MeshAction::kRebuild);
    EXPECT_NE(mess.report.meshes[0].reason.find("Leaves share triangles"), std::string::npos)
        << mess.report.meshes[0].reason;
    EXPECT_TRUE(wanted_trees(mess.report).empty());
    EXPECT_FALSE(better_tree(*mess.scene, 0));
    const blas::Blas& tree = mess.scene->blas(0);
    EXPECT_GT(tree.stats().reference_count, tree.stats().triangle_count);
    EXPECT_EQ(tree.stats().cost, fresh_tree(*mess.scene).stats().cost);
    const std::string reason = reason_of(tree, BuildQuality::kDefault);
    EXPECT_NE(reason.find("shared between leaves"), std::string::npos) << reason;
    EXPECT_TRUE(mess.scene->validate().ok());
    expect_same_answers(*mess.scene, *built(flattened(*mess.scene)), 200, 8);
  }
  // As a tree that was asked for, however many boxes a ray meets.
  const auto asked = moved(*scene, shuffled(positions_of(*scene), 3), UpdateMode::kRebuild);
  EXPECT_EQ(asked.scene->blas(0).stats().cost, fresh_tree(*asked.scene).stats().cost);
  EXPECT_EQ(fresh_tree(*scene).stats().reference_count, scene->blas(0).stats().triangle_count);
  EXPECT_EQ(reason_of(scene->blas(0), BuildQuality::kDefault).find("shared"), std::string::npos);
}

/// A refit gives every leaf of a shared triangle the box of the whole: the watch sees what that costs. A mesh
/// that rests has the tree that a scene with these vertices begins with, or one that is little worse.
TEST(TreeReplacement, trees_with_shared_triangles_are_replaced_when_their_boxes_have_grown) {
  auto scene = scene_of(6);
  const Positions start = positions_of(*scene);
  const Positions mess = shuffled(start, 3);
  scene = moved(*scene, mess).scene;
  const double shared_cost = scene->blas(0).stats().cost;
  Positions nudged = mess;
  for (Vec3f& p : nudged) p.x *= 1.001F;
  const auto refitted = moved(*scene, nudged, UpdateMode::kRefit).scene;
  EXPECT_GT(refitted->blas(0).stats().cost, 1.1 * shared_cost) << "boxes of whole triangles";
  EXPECT_GT(worsening(refitted->blas(0).stats()), 1.1);

  const auto settle = [&scene](const Positions& positions, double allowed) {
    scene = moved(*scene, positions).scene;
    if (const auto order = better_tree(*scene, 0))
      if (auto better = replaced(*scene, tree_of(*order))) scene = std::move(better);
    EXPECT_FALSE(better_tree(*scene, 0));
    EXPECT_TRUE(scene->validate().ok());
    EXPECT_LE(scene->blas(0).stats().cost, allowed * fresh_tree(*scene).stats().cost);
    return scene->blas(0).options().spatial;
  };
  EXPECT_EQ(settle(nudged, kOrderCostRatio), blas::SpatialSplits::kAuto);
  // Half of the way back: large triangles in other places.
  Positions between = mess;
  for (std::size_t i = 0; i < between.size(); ++i) between[i] = 0.5F * (mess[i] + start[i]);
  EXPECT_EQ(settle(between, kOrderCostRatio), blas::SpatialSplits::kAuto);
  EXPECT_EQ(settle(start, 1.01), blas::SpatialSplits::kNever);
  EXPECT_EQ(settle(scattered(start), 1.01), blas::SpatialSplits::kNever);
  EXPECT_EQ(settle(mess, 1.001), blas::SpatialSplits::kAuto);
}

TEST(TreeReplacement, a_tree_is_refitted_to_the_vertices_that_are_there_when_it_comes) {
  const auto scene = large_scene();
  const auto mess = moved(*scene, scattered(positions_of(*scene))).scene;
  const blas::Blas tree = tree_of(*better_tree(*mess, 0));
  Positions wider = positions_of(*mess);
  for (Vec3f& p : wider) p = Vec3f(1.5F * p.x, p.y, 0.5F * p.z);
  const auto later = moved(*mess, wider).scene;
  const auto better = replaced(*later, tree);
  ASSERT_NE(better, nullptr);
  EXPECT_EQ(better->version(), later->version());
  EXPECT_EQ(better->blas(0).mesh_ptr(), later->blas(0).mesh_ptr());
  EXPECT_EQ(better->blas(0).stats().refits_since_build, 1U);
  EXPECT_TRUE(better->validate().ok());
  expect_same_answers(*later, *better, 300, 5);
}

TEST(TreeReplacement, a_tree_that_came_too_late_is_refused) {
  const auto scene = large_scene();
  const auto mess = moved(*scene, scattered(positions_of(*scene))).scene;
  const blas::Blas tree = tree_of(*better_tree(*mess, 0));
  const auto in_order = moved(*mess, positions_of(*scene)).scene;
  EXPECT_EQ(refusal(*in_order, 0, tree), TreeRefusal::kNotBetter);
  const auto rebuilt = moved(*mess, positions_of(*mess), UpdateMode::kRebuild).scene;
  EXPECT_EQ(refusal(*rebuilt, 0, tree), TreeRefusal::kNotBetter) << "it is as good already";
  EXPECT_EQ(refusal(*mess, 1, tree), TreeRefusal::kMeshChanged) << "there is no such mesh";
  EXPECT_EQ(refusal(*large_scene(StructureKind::kBvh), 0, tree), TreeRefusal::kMeshChanged);
  EXPECT_EQ(refusal(*scene_of(3), 0, tree), TreeRefusal::kMeshChanged);
  auto renumbered = std::make_shared<mesh::TriangleMesh>(scene->blas(0).mesh());
  ++renumbered->topology_version;
  SceneData data;
  data.meshes = {renumbered};
  data.deformations.resize(1);
  EXPECT_EQ(refusal(*built(std::move(data)), 0, tree), TreeRefusal::kMeshChanged);
}

TEST(TreeReplacement, a_kd_tree_that_was_asked_for_gives_way_when_its_mesh_deforms) {
  for (const int level : {3, 5}) {  // below and above kFastRebuildTriangles
    const auto scene = scene_of(level, StructureKind::kKdTree);
    ASSERT_EQ(scene->blas(0).stats().kind, StructureKind::kKdTree);
    const auto first = moved(*scene, twisted(positions_of(*scene), 0.01));
    EXPECT_EQ(first.report.meshes[0].action, MeshAction::kRebuild);
    EXPECT_NE(first.report.meshes[0].reason.find("wide_bvh"), std::string::npos);
    EXPECT_EQ(first.scene->blas(0).stats().kind, StructureKind::kWideBvh);
    EXPECT_NE(first.scene->blas(0).stats().reason.find("kd-tree was asked for"), std::string::npos);
    EXPECT_EQ(better_tree(*first.scene, 0).has_value(), level == 5) << "large ones begin in Morton order";
    const auto second = moved(*first.scene, twisted(positions_of(*scene), 0.02));
    EXPECT_EQ(second.report.meshes[0].action, MeshAction::kRefit);
    const auto asked = moved(*second.scene, positions_of(*scene), UpdateMode::kRebuild);
    EXPECT_EQ(asked.scene->blas(0).stats().kind, StructureKind::kKdTree);
    expect_same_answers(*scene, *asked.scene, 100, 6);
  }
}

/// Trees come two frames late, into scenes whose own trees were refitted all the time.
TEST(TreeReplacement, a_hundred_frames_answer_like_scenes_built_anew_in_every_structure) {
  const std::uint64_t seed = test::seed_or(77);
  for (const auto kind : {StructureKind::kAuto, StructureKind::kBruteForce, StructureKind::kBvh,
                          StructureKind::kWideBvh, StructureKind::kCompactBvh, StructureKind::kKdTree}) {
    SCOPED_TRACE(std::string(to_string(kind)));
    auto scene = scene_of(3, kind);
    const Positions start = positions_of(*scene);
    scene = moved(*scene, start).scene;  // a kd-tree goes
    std::optional<blas::Blas> late;
    int replacements = 0;
    for (int frame = 0; frame < 100; ++frame) {
      const double part = 0.01 * frame;
      const Positions next = frame % 10 < 4   ? twisted(start, 2.0 * part)
                             : frame % 10 < 8 ? exploded(start, part, seed)
                                              : shuffled(start, seed + std::uint64_t(frame));
      scene = moved(*scene, next, UpdateMode::kRefit).scene;
      if (frame % 3 == 0)
        late = blas::Blas::build(scene->blas(0).mesh_ptr(), scene->blas(0).options()).value();
      if (frame % 3 != 2) continue;
      if (auto better = replaced(*scene, *late)) {
        scene = std::move(better);
        ++replacements;
      }
      SceneBuildOptions options;
      options.blas.kind = kind;
      ASSERT_NO_FATAL_FAILURE(expect_same_answers(*scene, *built(flattened(*scene), options), 60, seed))
          << "frame " << frame;
    }
    EXPECT_EQ(replacements > 5, kind != StructureKind::kBruteForce) << replacements;
    EXPECT_TRUE(scene->validate().ok());
  }
}

}  // namespace
}  // namespace gridcast::scene
