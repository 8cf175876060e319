#include <algorithm>
#include <filesystem>
#include <limits>

#include <gtest/gtest.h>

#include "tests/support/assets.h"
#include "tests/support/puppet.h"
#include "tests/unit/io/export_helpers.h"

namespace gridcast::test {
namespace {

using scene::SceneData;

/// Two boxes; the second is turned by a matrix of many digits.
SceneData two_boxes() {
  SceneData data;
  data.meshes = {share(box({-1, -1, -1}, {1, 1, 1}))};
  data.deformations.resize(1);
  Random random(3);
  scene::place(data, 0, {Mat3d(1.0), Vec3d(3.0, 0.0, 0.0)});
  scene::place(data, 0, scene::random_affine(random, 5.0, 0.7));
  return data;
}

TEST(GltfExport, generated_scenes_answer_with_the_same_bits_after_a_round_trip) {
  Random random(seed_or(61));
  for (auto& [name, data] : scene::awkward_scenes(60, random)) {
    SCOPED_TRACE(name);
    const auto before = scene::built(std::move(data));
    const auto after = read_back(exported(*before));
    EXPECT_GT(expect_same_answers(*before, *after, 3000, random.bits()), 300);
  }
}

TEST(GltfExport, a_second_round_trip_gives_the_same_bytes) {
  Random random(62);
  for (auto& [name, data] : scene::awkward_scenes(40, random)) {
    const std::string first = exported(*scene::built(std::move(data)));
    EXPECT_TRUE(first == exported(*read_back(first))) << name;
  }
}

TEST(GltfExport, transforms_keep_every_bit) {
  SceneData data = two_boxes();
  const double tiny = std::numeric_limits<double>::denorm_min();
  const std::vector<Affine> kept = {
      {Mat3d(1.0), Vec3d(0.1, -0.0, 1e300 * 1e-280)},
      {Mat3d(2.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0 / 3.0), Vec3d(1.0 / 3.0, 1e22, -1e-22)},
      {Mat3d(-2.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0), Vec3d(0.0)},
      {Mat3d(1.0, -0.0, 0.0, 0.0, 1.0, tiny, 0.0, 0.0, 1.0),
       Vec3d(123456789012345678.0, tiny, 9007199254740993.0)},
      {Mat3d(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0), Vec3d(-4194304.000000001, 0.0, 0x1p99)},
  };
  for (const Affine& affine : kept) scene::place(data, 0, affine);
  const auto before = scene::built(std::move(data));
  const auto after = read_back(exported(*before));
  ASSERT_EQ(after->instance_slots(), before->instance_slots());
  for (std::uint32_t id = 0; id < before->instance_slots(); ++id) {
    const Affine a = before->instance(id).transform.world_from_object();
    const Affine b = after->instance(id).transform.world_from_object();
    EXPECT_EQ(std::memcmp(&a.linear, &b.linear, sizeof a.linear), 0) << id;
    EXPECT_EQ(std::memcmp(&a.translation, &b.translation, sizeof a.translation), 0) << id;
  }
}

TEST(GltfExport, packaged_models_answer_with_the_same_bits_at_rest_and_in_a_pose) {
  GRIDCAST_REQUIRE_ASSET(folder, assimp_model("glTF2"));
  int models = 0, posed_models = 0, hits = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".glb" && entry.path().extension() != ".gltf") continue;
    auto data = io::import_gltf_file(entry.path());
    if (!data) continue;
    SCOPED_TRACE(entry.path().filename().string());
    const auto rest = scene::build_scene(*std::move(data)).value();
    if (rest->bounds().empty()) continue;
    hits += expect_same_answers(*rest, *read_back(exported(*rest)), 500, 63);
    ++models;
    if (rest->data().animations.empty()) continue;
    scene::SetPose pose;
    pose.animation = scene::AnimationTime{0U, 0.37, scene::AnimationWrap::kLoop};
    const auto posed = scene::apply_update(*rest, {pose});
    if (!posed) continue;
    hits += expect_same_answers(*posed->scene, *read_back(exported(*posed->scene)), 500, 64);
    ++posed_models;
  }
  EXPECT_GE(models, 10);
  EXPECT_GE(posed_models, 1);
  EXPECT_GT(hits, 100 * models);
}

TEST(GltfExport, the_present_pose_is_baked) {
  const auto before = scene::apply_update(*scene::built(puppet()), {waving(), stretched()}).value().scene;
  const std::string glb = exported(*before);
  const Glb parts = take_apart(glb);
  for (const char* gone : {"skins", "animations"}) EXPECT_FALSE(parts.document.contains(gone)) << gone;
  EXPECT_EQ(parts.document["asset"]["extras"]["scene_version"], "2");
  const auto after = read_back(glb);
  EXPECT_GT(expect_same_answers(*before, *after, 3000, 65), 300);
  EXPECT_TRUE(after->blas(0).mesh().positions == before->blas(0).mesh().positions);
  EXPECT_FALSE(after->blas(0).mesh().positions == scene::built(puppet())->blas(0).mesh().positions);
}

TEST(GltfExport, removed_instances_leave_no_gap_and_the_rest_tell_their_old_ids) {
  Random random(66);
  const auto start = scene::start_scene(random, 30);
  const std::vector<scene::SceneEdit> edits = {scene::RemoveInstance{3}, scene::RemoveInstance{17},
                                               scene::AddInstance{1, {Mat3d(0.5), Vec3d(0.25)}, "new"},
                                               scene::RemoveInstance{29}};
  const auto before = scene::apply_update(*start, edits).value().scene;
  const std::string glb = exported(*before);
  const auto after = read_back(glb);
  EXPECT_EQ(after->instance_slots(), 28U);
  EXPECT_GT(expect_same_answers(*before, *after, 3000, 67), 300);
  const auto nodes = take_apart(glb).document["nodes"];
  EXPECT_FALSE(nodes[2].contains("extras"));
  EXPECT_EQ(nodes[3]["extras"]["instance_id"], 4);
  EXPECT_EQ(nodes[27]["extras"]["instance_id"], 30);
  EXPECT_EQ(nodes[27]["name"], "new");
}

TEST(GltfExport, an_instance_without_size_keeps_its_place_and_is_not_hit) {
  SceneData data = two_boxes();
  scene::place(data, 0, {Mat3d(0.0), Vec3d(1.0)});
  scene::place(data, 0, {Mat3d(1, 2, 3, 2, 4, 6, 0, 0, 1), Vec3d(0.0)});
  scene::place(data, 0, {Mat3d(1e200), Vec3d(1e300)});
  scene::place(data, 0, {Mat3d(1.0), Vec3d(-3.0, 0.0, 0.0)});
  const auto before = scene::built(std::move(data));
  const auto after = read_back(exported(*before));
  ASSERT_EQ(after->instance_slots(), 6U);
  for (std::uint32_t id = 0; id < 6; ++id)
    EXPECT_EQ(after->instance(id).transform.active(), before->instance(id).transform.active()) << id;
  EXPECT_EQ(intersect(*after, {{-3, 0, 9}, {0, 0, -1}}).instance_id, 5U);
}

TEST(GltfExport, parts_keep_their_materials_vertices_and_triangles) {
  mesh::TriangleMesh mesh = torus(24, 12);
  const auto all = std::uint32_t(mesh.triangle_count());
  // The first two parts share vertices, the rest is a copy that does not; a part is empty, a vertex unused.
  const auto base = std::uint32_t(mesh.positions.size());
  for (std::uint32_t v = 0; v < base; ++v) mesh.positions.push_back(mesh.positions[v] + Vec3f(5.F, 0.F, 0.F));
  mesh.positions.emplace_back(9.F, 9.F, 9.F);
  for (std::uint32_t k = 0; k < all; ++k) {
    const mesh::Triangle t = mesh.triangles[k];
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
  mesh.parts = {{0, all / 2, 1}, {all / 2, all - all / 2, kInvalidId}, {all, 0, 0}, {all, all, 0}};
  SceneData data;
  data.materials = {{.name = "red"}, {.name = "blue"}};
  data.meshes = {share(mesh)};
  data.deformations.resize(1);
  scene::place(data, 0, {});
  const std::string glb = exported(*scene::built(std::move(data)));
  const auto after = read_back(glb);
  const mesh::TriangleMesh& read = after->blas(0).mesh();
  EXPECT_TRUE(read.positions == mesh.positions);
  EXPECT_TRUE(read.triangles == mesh.triangles);
  ASSERT_EQ(read.parts.size(), 3U);
  EXPECT_EQ(read.parts[0].material_id, 1U);
  EXPECT_EQ(read.parts[1].material_id, kInvalidId);
  EXPECT_EQ(read.parts[2].material_id, 0U);
  EXPECT_EQ(read.parts[2].first_triangle, all);
  const auto primitives = take_apart(glb).document["meshes"][0]["primitives"];
  EXPECT_EQ(primitives[0]["attributes"], primitives[1]["attributes"]) << "they share their vertices";
  EXPECT_NE(primitives[0]["attributes"], primitives[2]["attributes"]) << "no primitive names all vertices";
}

TEST(GltfExport, a_part_that_reaches_back_keeps_the_order_of_the_vertices) {
  mesh::TriangleMesh mesh = soup(40, 70);
  // Parts 0, 1 and 2 have vertices of their own; 3 has some of 1 and of 2.
  mesh.triangles.push_back({40, 70, 100});
  mesh.parts = {{0, 10, 0}, {10, 10, 1}, {20, 20, 0}, {40, 1, 1}};
  SceneData data;
  data.materials.resize(2);
  data.meshes = {share(mesh)};
  data.deformations.resize(1);
  scene::place(data, 0, {});
  const std::string glb = exported(*scene::built(std::move(data)));
  const auto after = read_back(glb);
  EXPECT_TRUE(after->blas(0).mesh().positions == mesh.positions);
  EXPECT_TRUE(after->blas(0).mesh().triangles == mesh.triangles);
  const auto primitives = take_apart(glb).document["meshes"][0]["primitives"];
  EXPECT_NE(primitives[0]["attributes"], primitives[1]["attributes"]);
  EXPECT_EQ(primitives[1]["attributes"], primitives[3]["attributes"]);
}

TEST(GltfExport, accessors_tell_the_bounds_of_what_they_hold) {
  const Glb parts = take_apart(exported(*scene::built(two_boxes())));
  const auto& accessor = parts.document["accessors"][0];
  EXPECT_EQ(accessor["min"], nlohmann::json({-1.0, -1.0, -1.0}));
  EXPECT_EQ(accessor["max"], nlohmann::json({1.0, 1.0, 1.0}));
  EXPECT_EQ(parts.document["buffers"][0]["byteLength"], parts.bin.size());
  std::size_t end = 0;
  for (const auto& view : parts.document["bufferViews"]) {
    EXPECT_EQ(view["byteOffset"], end);
    end += view["byteLength"].get<std::size_t>();
  }
  EXPECT_EQ(end, parts.bin.size());
}

TEST(GltfExport, scenes_without_meshes_or_with_empty_ones_can_be_written) {
  EXPECT_EQ(read_back(exported(*scene::built({})))->mesh_count(), 0U);
  SceneData data = two_boxes();
  data.meshes.insert(data.meshes.begin(), share({}));
  mesh::TriangleMesh dots;
  dots.name = "dots";
  dots.positions = {{1, 2, 3}, {4, 5, 6}};
  data.meshes.push_back(share(dots));
  data.deformations.resize(3);
  for (auto& instance : data.instances) instance.mesh_id = 1;
  scene::place(data, 0, {});
  scene::place(data, 2, {});
  const auto before = scene::built(std::move(data));
  const auto after = read_back(exported(*before));
  ASSERT_EQ(after->mesh_count(), 3U);
  EXPECT_EQ(after->blas(0).mesh().triangle_count(), 0U);
  EXPECT_EQ(after->blas(2).mesh().name, "dots");
  EXPECT_GT(expect_same_answers(*before, *after, 500, 68), 50);
}

TEST(GltfExport, names_of_any_characters_come_back) {
  const std::string odd = "a \"quoted\" \\ name\n\t\x01 \u00fc \u6f22\U0001F600";
  SceneData data = two_boxes();
  data.name = odd;
  mesh::TriangleMesh named = *data.meshes[0];
  named.name = odd + "m";
  data.meshes[0] = share(named);
  data.instances[1].name = odd + "i";
  data.materials = {{.name = odd}};
  const auto after = import_ok(as_vector(exported(*scene::built(std::move(data)))));
  EXPECT_EQ(after.name, odd);
  EXPECT_EQ(after.meshes[0]->name, odd + "m");
  EXPECT_EQ(after.instances[0].name.str(), "");
  EXPECT_EQ(after.instances[1].name.str(), odd + "i");
  EXPECT_EQ(after.materials[0].name, odd);
}

TEST(GltfExport, a_name_that_is_no_utf8_is_repaired) {
  SceneData data = two_boxes();
  data.instances[0].name = std::string("a\xFFz");
  EXPECT_EQ(import_ok(as_vector(exported(*scene::built(std::move(data))))).instances[0].name.str(),
            "a\uFFFDz");
}

TEST(GltfExport, what_passes_a_limit_is_refused) {
  Random random(69);
  const auto scene = scene::start_scene(random, 40);
  const auto refused = [&](auto change) {
    io::ExportOptions options;
    change(options.limits);
    const auto glb = io::export_glb(*scene, options);
    EXPECT_FALSE(glb.ok());
    return glb ? ErrorCode::kInternal : glb.error().code;
  };
  EXPECT_EQ(refused([](io::GltfLimits& l) { l.nodes = 39; }), ErrorCode::kLimitExceeded);
  EXPECT_EQ(refused([](io::GltfLimits& l) { l.instances = 39; }), ErrorCode::kLimitExceeded);
  EXPECT_EQ(refused([](io::GltfLimits& l) { l.json_bytes = 9000; }), ErrorCode::kLimitExceeded);
  const std::size_t size = exported(*scene).size();
  EXPECT_EQ(refused([&](io::GltfLimits& l) { l.file_bytes = size - 1; }), ErrorCode::kLimitExceeded);
  EXPECT_EQ(refused([&](io::GltfLimits& l) { l.file_bytes = 1000; }), ErrorCode::kLimitExceeded);
  io::ExportOptions enough;
  enough.limits.nodes = enough.limits.instances = 40;
  enough.limits.file_bytes = size;
  EXPECT_TRUE(io::export_glb(*scene, enough).ok());
  io::GltfOptions same;
  same.limits = enough.limits;
  EXPECT_EQ(import_ok(as_vector(exported(*scene)), same).instances.size(), 40U);
  EXPECT_GE(io::export_memory_bytes(*scene), size);
}

TEST(GltfExport, it_stops_when_asked) {
  std::stop_source source;
  source.request_stop();
  const auto glb = io::export_glb(*scene::built(two_boxes()), {{}, source.get_token()});
  ASSERT_FALSE(glb.ok());
  EXPECT_EQ(glb.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace gridcast::test
