#include "core/scene/update.h"

#include <atomic>
#include <thread>

#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

/// The same instances under the same ids, built from nothing. Removed slots get a singular transform.
std::shared_ptr<const Scene> built_anew(const Scene& scene) {
  SceneData data;
  for (std::uint32_t id = 0; id < scene.mesh_count(); ++id) data.meshes.push_back(scene.blas(id).mesh_ptr());
  data.deformations.resize(data.meshes.size());
  for (std::uint32_t id = 0; id < scene.instance_slots(); ++id) {
    const Instance instance = scene.instance(id);
    place(data, instance.mesh_id,
          instance.alive ? instance.transform.world_from_object() : Affine{Mat3d(0.0), {}});
  }
  return built(std::move(data));
}

void expect_same_answers(const Scene& a, const Scene& b, test::Random& random, int rays) {
  for (int i = 0; i < rays; ++i) {
    const Ray ray = random_ray(a, random);
    ASSERT_TRUE(same(intersect(a, ray), intersect(b, ray)));
  }
}

void expect_valid(const Scene& scene) {
  const Status status = scene.validate();
  ASSERT_TRUE(status.ok()) << status.error().message << " " << status.error().where;
}

SceneEdit random_edit(const Scene& scene, std::vector<std::uint32_t>& alive, test::Random& random) {
  const std::uint32_t kind = random.below(10);
  const std::size_t pick = random.below(std::uint32_t(alive.size()));
  if (kind < 2) return AddInstance{random.below(4), random_affine(random, 8.0, 0.5), "added"};
  if (kind < 3) {
    const std::uint32_t id = alive[pick];
    alive.erase(alive.begin() + std::ptrdiff_t(pick));
    return RemoveInstance{id};
  }
  if (kind < 9)
    return MoveInstance{alive[pick], random_affine(random, random.below(20) == 0 ? 60.0 : 8.0, 0.5)};
  const std::uint32_t mesh_id = random.below(4);
  const auto& old = scene.blas(mesh_id).mesh().positions;
  ReplaceVertices edit{mesh_id, {}, {}, UpdateMode(random.below(3))};
  if (random.below(2) == 0) {
    for (const Vec3f& p : old) edit.positions.push_back(p * float(random.uniform(0.8, 1.3)));
  } else {
    edit.vertex_ids = {3, 1};
    edit.positions = {old[3] * 1.5F, old[1] * 0.5F};
  }
  return edit;
}

TEST(SceneUpdate, random_updates_answer_like_a_scene_built_anew_and_leave_the_old_one_alone) {
  test::Random random(test::seed_or(41));
  std::shared_ptr<const Scene> scene = start_scene(random, 200);
  const std::shared_ptr<const Scene> first = scene, first_again = built_anew(*scene);
  for (int round = 0; round < 40; ++round) {
    std::vector<std::uint32_t> alive;
    for (std::uint32_t id = 0; id < scene->instance_slots(); ++id)
      if (scene->find_instance(id)) alive.push_back(id);
    std::vector<SceneEdit> edits;
    for (std::uint32_t k = 0; k <= random.below(6); ++k) edits.push_back(random_edit(*scene, alive, random));
    const auto result = apply_update(*scene, edits);
    ASSERT_TRUE(result.ok()) << result.error().message << result.error().where;
    ASSERT_EQ(result->scene->version(), scene->version() + 1);
    scene = result->scene;
    ASSERT_NO_FATAL_FAILURE(expect_valid(*scene));
    ASSERT_NO_FATAL_FAILURE(expect_same_answers(*scene, *built_anew(*scene), random, 30));
  }
  EXPECT_EQ(first->version(), 1U);
  ASSERT_NO_FATAL_FAILURE(expect_valid(*first));
  expect_same_answers(*first, *first_again, random, 200);
}

TEST(SceneUpdate, counts_names_and_ids_follow_the_edits) {
  test::Random random(42);
  const auto scene = start_scene(random, 5);
  const auto result =
      apply_update(*scene, {AddInstance{0, {}, "new"}, RemoveInstance{2}, AddInstance{1, {}, ""},
                            AddMesh{test::share(test::single_triangle())}, AddInstance{4, {}, "tri"}});
  ASSERT_TRUE(result.ok());
  const Scene& next = *result->scene;
  EXPECT_EQ(result->report.added_instances, (std::vector<std::uint32_t>{5, 6, 7}));
  EXPECT_EQ(result->report.added_meshes, std::vector<std::uint32_t>{4});
  EXPECT_EQ(next.instance_count(), 7U);
  EXPECT_EQ(next.instance_slots(), 8U);
  EXPECT_FALSE(next.find_instance(2));
  EXPECT_FALSE(next.find_instance(8));
  EXPECT_EQ(next.instance_name(5), "new");
  EXPECT_EQ(next.instance_name(6), "");
  EXPECT_EQ(next.instance_name(7), "tri");
  std::uint64_t triangles = 0;
  for (std::uint32_t id = 0; id < next.instance_slots(); ++id)
    if (next.find_instance(id)) triangles += next.blas(next.instance(id).mesh_id).mesh().triangle_count();
  EXPECT_EQ(next.world_triangle_count(), triangles);
}

TEST(SceneUpdate, a_failing_edit_names_its_place_and_nothing_changes) {
  test::Random random(43);
  const auto scene = start_scene(random, 10);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::size_t vertices = scene->blas(2).mesh().positions.size();
  std::vector<Vec3f> bad(vertices, Vec3f(0.F));
  bad[4].y = nan;
  const struct {
    SceneEdit edit;
    ErrorCode code;
    std::string where;
  } cases[] = {
      {MoveInstance{99, {}}, ErrorCode::kNotFound, "/edits/1/instance_id"},
      {RemoveInstance{10}, ErrorCode::kNotFound, "/edits/1/instance_id"},
      {AddInstance{4, {}, ""}, ErrorCode::kNotFound, "/edits/1/mesh_id"},
      {MoveInstance{1, {Mat3d(0.0), {}}}, ErrorCode::kInvalidArgument, "/edits/1/world_from_object"},
      {AddInstance{1, {Mat3d(double(nan)), {}}, ""}, ErrorCode::kInvalidArgument,
       "/edits/1/world_from_object"},
      {ReplaceVertices{9, {}, {}}, ErrorCode::kNotFound, "/edits/1/mesh_id"},
      {ReplaceVertices{2, {Vec3f(0.F)}, {}}, ErrorCode::kInvalidArgument, "/edits/1/positions"},
      {ReplaceVertices{2, bad, {}}, ErrorCode::kInvalidArgument, "/edits/1/positions/4"},
      {ReplaceVertices{2, {Vec3f(0.F)}, {std::uint32_t(vertices)}}, ErrorCode::kInvalidArgument,
       "/edits/1/vertex_ids/0"},
      {ReplaceVertices{2, {Vec3f(0.F), Vec3f(0.F)}, {1, 1}}, ErrorCode::kInvalidArgument,
       "/edits/1/vertex_ids/1"},
      {AddMesh{nullptr}, ErrorCode::kInvalidArgument, "/edits/1/mesh"},
  };
  for (const auto& [edit, code, where] : cases) {
    const auto result = apply_update(*scene, {MoveInstance{0, {Mat3d(1.0), Vec3d(100.0)}}, edit});
    ASSERT_FALSE(result.ok()) << where;
    EXPECT_EQ(result.error().code, code);
    EXPECT_EQ(result.error().where, where);
  }
  EXPECT_EQ(scene->version(), 1U);
  expect_valid(*scene);
  expect_same_answers(*scene, *built_anew(*scene), random, 100);
}

TEST(SceneUpdate, a_small_move_refits_and_a_scramble_rebuilds_and_both_say_so) {
  test::Random random(44);
  SceneData data;
  data.meshes.push_back(test::share(test::jittered_icosphere(3, 5)));
  place(data, 0, {});
  const auto scene = built(std::move(data));
  const auto& old = scene->blas(0).mesh().positions;
  ReplaceVertices small{0, old, {}}, scramble{0, old, {}};
  for (Vec3f& p : small.positions) p *= 1.01F;
  for (Vec3f& p : scramble.positions) p = Vec3f(random.in_box(1.0));

  const auto refitted = apply_update(*scene, {small});
  ASSERT_TRUE(refitted.ok());
  EXPECT_EQ(refitted->report.meshes[0].action, MeshAction::kRefit);
  EXPECT_FALSE(refitted->report.meshes[0].reason.empty());
  EXPECT_EQ(refitted->scene->blas(0).mesh().vertex_version, scene->blas(0).mesh().vertex_version + 1);
  const auto rebuilt = apply_update(*scene, {scramble});
  ASSERT_TRUE(rebuilt.ok());
  EXPECT_EQ(rebuilt->report.meshes[0].action, MeshAction::kRebuild);
  EXPECT_NE(rebuilt->report.meshes[0].reason.find("exceeds"), std::string::npos);

  scramble.mode = UpdateMode::kRefit;
  const auto forced = apply_update(*scene, {scramble});
  ASSERT_TRUE(forced.ok());
  EXPECT_EQ(forced->report.meshes[0].action, MeshAction::kRefit);
  EXPECT_GT(forced->report.meshes[0].cost_after, rebuilt->report.meshes[0].cost_after);
  expect_same_answers(*forced->scene, *rebuilt->scene, random, 200);
}

TEST(SceneUpdate, auto_keeps_meshes_that_deform_out_of_kd_trees) {
  const auto slivers = test::share(test::slivers(8000, 4, 1000.F));
  SceneData data;
  data.meshes = {slivers, slivers};
  data.deformations.resize(2);
  data.deformations[1].morph_targets.resize(1);
  place(data, 0, {});
  const auto scene = built(std::move(data));
  EXPECT_EQ(scene->blas(0).stats().kind, blas::StructureKind::kKdTree) << scene->blas(0).stats().reason;
  EXPECT_EQ(scene->blas(1).stats().kind, blas::StructureKind::kWideBvh) << scene->blas(1).stats().reason;

  ReplaceVertices moved{0, slivers->positions, {}};
  moved.mode = UpdateMode::kRefit;
  const auto first = apply_update(*scene, {moved});
  ASSERT_TRUE(first.ok());
  EXPECT_EQ(first->report.meshes[0].action, MeshAction::kRebuild) << "a kd-tree cannot be refitted";
  EXPECT_EQ(first->scene->blas(0).stats().kind, blas::StructureKind::kWideBvh);
  const auto second = apply_update(*first->scene, {moved});
  ASSERT_TRUE(second.ok());
  EXPECT_EQ(second->report.meshes[0].action, MeshAction::kRefit);
}

TEST(SceneUpdate, edits_of_one_mesh_compose_and_normals_follow) {
  SceneData data;
  mesh::TriangleMesh flat = test::quad_grid(2);
  flat.normals.assign(flat.positions.size(), Vec3f(1, 0, 0));
  data.meshes.push_back(test::share(flat));
  place(data, 0, {});
  const auto scene = built(std::move(data));
  std::vector<Vec3f> lifted = flat.positions;
  for (Vec3f& p : lifted) p.z = 2.F;
  const auto result =
      apply_update(*scene, {ReplaceVertices{0, lifted, {}}, ReplaceVertices{0, {{-9, -9, 9}}, {0}}});
  ASSERT_TRUE(result.ok());
  lifted[0] = {-9, -9, 9};
  const mesh::TriangleMesh& mesh = result->scene->blas(0).mesh();
  EXPECT_EQ(mesh.positions, lifted);
  EXPECT_EQ(result->report.meshes.size(), 2U);
  EXPECT_NEAR(std::abs(mesh.normals.back().z), 1.F, 1e-6F);
  EXPECT_EQ(intersect(*result->scene, {{0.8, 0.9, 5}, {0, 0, -1}}).t, 3.0);
}

TEST(SceneUpdate, readers_of_old_snapshots_are_undisturbed_while_updates_run) {
  test::Random random(test::seed_or(45));
  const auto first = start_scene(random, 150);
  std::vector<Ray> rays;
  std::vector<SurfaceHit> golden;
  for (int i = 0; i < 100; ++i) {
    rays.push_back(random_ray(*first, random));
    golden.push_back(intersect(*first, rays.back()));
  }
  std::atomic<bool> done = false;
  std::atomic<int> wrong = 0;
  std::thread reader([&] {
    do {
      for (std::size_t i = 0; i < rays.size(); ++i)
        if (!same(intersect(*first, rays[i]), golden[i])) ++wrong;
    } while (!done);
  });
  auto scene = first;
  for (int round = 0; round < 30; ++round) {
    std::vector<SceneEdit> edits;
    for (std::uint32_t id = 0; id < 20; ++id)
      edits.emplace_back(MoveInstance{random.below(150), random_affine(random, 8.0, 0.5)});
    edits.emplace_back(ReplaceVertices{2, {Vec3f(-1.F - 0.01F * float(round))}, {0}});
    auto result = apply_update(*scene, edits);
    EXPECT_TRUE(result.ok());
    scene = result->scene;
  }
  done = true;
  reader.join();
  EXPECT_EQ(wrong, 0);
}

TEST(SceneBuild, an_invalid_mesh_or_mesh_id_is_named) {
  SceneData data = meshes_only();
  mesh::TriangleMesh broken = test::single_triangle();
  broken.triangles[0][2] = 17;
  data.meshes[2] = test::share(broken);
  auto result = build_scene(data);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().where, "/meshes/2/triangles/0");
  data = meshes_only();
  place(data, 0, {});
  place(data, 4, {});
  result = build_scene(data);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().where, "/instances/1/mesh_id");
}

TEST(SceneBuild, singular_instances_are_kept_warned_about_and_never_hit) {
  SceneData data = meshes_only();
  place(data, 0, {Mat3d(0.0), Vec3d(0.0)});
  place(data, 0, {Mat3d(1, 0, 0, 0, 1, 0, 0, 0, 0), Vec3d(0.0)});
  for (int i = 0; i < 50; ++i) place(data, 0, {Mat3d(std::numeric_limits<double>::infinity()), Vec3d(0.0)});
  const auto scene = built(std::move(data));
  EXPECT_EQ(scene->instance_count(), 52U);
  EXPECT_EQ(scene->data().warnings.size(), 21U);
  EXPECT_EQ(intersect(*scene, {{0, 0, 5}, {0, 0, -1}}).status, RayStatus::kMiss);
}

TEST(SceneBuild, a_stopped_build_is_cancelled_and_progress_ends_at_one) {
  SceneData data = meshes_only();
  place(data, 0, {});
  SceneBuildOptions options;
  std::atomic<double> last = 0.0;  // progress comes from any thread
  options.progress = [&](double fraction) { last = fraction; };
  EXPECT_TRUE(build_scene(data, options).ok());
  EXPECT_EQ(last, 1.0);
  std::stop_source stop;
  stop.request_stop();
  options.stop = stop.get_token();
  const auto result = build_scene(data, options);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::scene
