// Trees that a restart need not build: found again, and never served when they are not what they should be.

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "core/blas/tree_codec.h"
#include "core/scene/tree_replacement.h"
#include "server/store/scene_archive.h"
#include "server/store/scene_codec.h"
#include "tests/support/same_scene.h"
#include "tests/support/shapes.h"

namespace gridcast::server::store {
namespace {

namespace fs = std::filesystem;
using blas::StructureKind;
using ScenePtr = std::shared_ptr<const scene::Scene>;

constexpr std::chrono::minutes kLong{1};

ScenePtr sphere(StructureKind kind = StructureKind::kAuto, int level = 4) {
  scene::SceneData data;
  data.meshes = {test::share(test::jittered_icosphere(level, 5))};
  data.deformations.resize(1);
  data.instances.push_back({scene::SharedText("sphere"), {}, 0});
  scene::SceneBuildOptions options;
  options.blas.kind = kind;
  return scene::build_scene(std::move(data), options).value();
}

ScenePtr moved(const scene::Scene& scene, float by,
               scene::RebuildPlace place = scene::RebuildPlace::kInUpdate) {
  std::vector<Vec3f> positions = scene.blas(0).mesh().positions;
  for (Vec3f& p : positions) p.x += by * p.y * p.y;
  return apply_update(scene, {scene::ReplaceVertices{0, std::move(positions), {}, scene::UpdateMode::kAuto}},
                      {place})
      .value()
      .scene;
}

std::string tree_of(const scene::Scene& scene) {
  return blas::encode_tree(scene.blas(0)).value();
}

class KeptTreesTest : public testing::Test {
 protected:
  KeptTreesTest() {
    std::string name = (fs::temp_directory_path() / "gridcast_kept_XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    options_.trees.rest = std::chrono::milliseconds(0);
  }
  ~KeptTreesTest() override { fs::remove_all(folder_); }

  [[nodiscard]] std::unique_ptr<SceneArchive> open() const {
    return SceneArchive::open(folder_.string(), options_).value();
  }
  /// A scene is stored, and served until the orderly end.
  TreeCounts store(const ScenePtr& scene) const {
    const auto archive = open();
    archive->all_restored();
    const std::int64_t key = archive->create("a", {}, *scene, 1).value();
    archive->served(key, scene);
    archive->finish(kLong);
    return archive->counts().trees;
  }
  struct Life {
    ScenePtr scene;
    TreeCounts trees;
  };
  /// What a later process finds, and keeps at its orderly end.
  [[nodiscard]] Life restarted() const {
    const auto archive = open();
    const SceneRow row = archive->scenes().value().at(0);
    Life life{archive->restore(row, {}).value(), {}};
    archive->served(row.key, life.scene);
    archive->all_restored();
    archive->finish(kLong);
    life.trees = archive->counts().trees;
    return life;
  }
  [[nodiscard]] std::vector<fs::path> files() const {
    std::vector<fs::path> paths;
    for (const auto& entry : fs::directory_iterator(folder_ / "structures")) paths.push_back(entry.path());
    return paths;
  }
  /// The next process notices, serves the same answers and mends it; the one after is glad of it.
  void expect_noticed_and_mended(const scene::Scene& original) const {
    const Life first = restarted();
    EXPECT_EQ(first.trees.found, 0U);
    EXPECT_EQ(first.trees.rejected, 1U);
    EXPECT_EQ(first.trees.kept, 1U);
    EXPECT_TRUE(first.scene->validate().ok());
    test::expect_same_scene(original, *first.scene);
    EXPECT_EQ(restarted().trees.found, 1U);
  }

  fs::path folder_;
  ArchiveOptions options_;
};

TEST_F(KeptTreesTest, a_restart_has_every_kind_of_tree_as_it_was_built) {
  for (const StructureKind kind : {StructureKind::kAuto, StructureKind::kBvh, StructureKind::kWideBvh,
                                   StructureKind::kCompactBvh, StructureKind::kKdTree}) {
    const ScenePtr scene = sphere(kind);
    EXPECT_EQ(store(scene).kept, 1U);
    const Life life = restarted();
    EXPECT_EQ(life.trees.found, 1U);
    EXPECT_EQ(life.trees.kept, 0U) << "what is there is not written again";
    EXPECT_TRUE(tree_of(*life.scene) == tree_of(*scene)) << "with its times: it was not built again";
    test::expect_same_scene(*scene, *life.scene);
    fs::remove_all(folder_);
  }
}

TEST_F(KeptTreesTest, small_meshes_and_structures_that_cannot_be_written_are_built) {
  EXPECT_EQ(store(sphere(StructureKind::kAuto, 2)).kept, 0U);
  fs::remove_all(folder_);
  EXPECT_EQ(store(sphere(StructureKind::kEmbree)).kept, 0U);
  EXPECT_EQ(restarted().trees.found, 0U);
  fs::remove_all(folder_);
  options_.trees.bytes = 0;
  EXPECT_EQ(store(sphere()).kept, 0U);
  EXPECT_FALSE(fs::exists(folder_ / "structures"));
  EXPECT_EQ(restarted().scene->version(), 1U);
}

TEST_F(KeptTreesTest, damage_anywhere_is_noticed_named_and_mended) {
  const ScenePtr scene = sphere();
  store(scene);
  const fs::path file = files().at(0);
  const std::uintmax_t size = fs::file_size(file);
  for (const std::uintmax_t at : {std::uintmax_t(0), std::uintmax_t(5), std::uintmax_t(20),
                                  std::uintmax_t(50), std::uintmax_t(75), size / 3, size / 2, size - 1}) {
    SCOPED_TRACE(at);
    {
      std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
      stream.seekg(std::streamoff(at));
      const int byte = stream.get();
      stream.seekp(std::streamoff(at));
      stream.put(char(byte ^ 4));
    }
    expect_noticed_and_mended(*scene);
  }
  for (const std::uintmax_t length : {std::uintmax_t(0), std::uintmax_t(71), std::uintmax_t(72), size - 1}) {
    SCOPED_TRACE(length);
    fs::resize_file(file, length);
    expect_noticed_and_mended(*scene);
  }
  fs::remove(file);
  EXPECT_EQ(restarted().trees.kept, 1U);
}

// With a checksum that fits: only the reader can know.
TEST_F(KeptTreesTest, a_tree_that_is_not_the_one_that_was_asked_for_is_never_served) {
  const ScenePtr scene = sphere(), other = sphere(StructureKind::kBvh);
  store(scene);
  const Digest mesh = sha256(encode(scene->blas(0).mesh()));
  const Digest key = tree_key(mesh, scene->blas(0).options());
  ASSERT_EQ(files().at(0).filename(), to_hex(key));
  std::string lie = tree_of(*scene);
  lie.back() = char(lie.back() ^ 0x40);
  std::string newer = tree_of(*scene);
  newer[4] = 77;
  for (const std::string& tree :
       {tree_of(*other), tree_of(*sphere(StructureKind::kAuto, 5)), std::string("nonsense"), lie, newer}) {
    {
      TreeFiles trees((folder_ / "structures").string(), options_.trees.bytes);
      ASSERT_TRUE(trees.open());
      ASSERT_TRUE(trees.put(key, tree));
    }
    expect_noticed_and_mended(*scene);
  }
}

TEST_F(KeptTreesTest, what_moved_is_kept_as_it_came_to_rest_and_what_it_was_goes) {
  const ScenePtr first = sphere(StructureKind::kWideBvh);
  const ScenePtr second = moved(*first, 0.1F), third = moved(*second, 0.2F);
  {
    const auto archive = open();
    archive->all_restored();
    const std::int64_t key = archive->create("a", {}, *first, 1).value();
    archive->served(key, first);
    ASSERT_TRUE(archive->append(key, *first, second));
    ASSERT_TRUE(archive->append(key, *second, third));
    archive->finish(kLong);
  }
  EXPECT_EQ(files().size(), 1U);
  const Life life = restarted();
  EXPECT_EQ(life.trees.found, 1U);
  EXPECT_TRUE(tree_of(*life.scene) == tree_of(*third));
  test::expect_same_scene(*third, *life.scene);
  EXPECT_EQ(life.scene->blas(0).stats().refits_since_build, 2U);
  // And goes on from there.
  const ScenePtr next = moved(*third, 0.1F), next_again = moved(*life.scene, 0.1F);
  test::expect_same_scene(*next, *next_again);
}

TEST_F(KeptTreesTest, a_tree_that_came_from_the_background_is_found) {
  const ScenePtr first = sphere(StructureKind::kWideBvh, 5);
  std::vector<Vec3f> positions = first->blas(0).mesh().positions;
  test::Random random(3);
  // So far that the tree is of no use, and not so far that boxes crowd and the update builds the best tree.
  for (Vec3f& p : positions) p += Vec3f(0.3 * random.direction());
  const ScenePtr second =
      apply_update(*first, {scene::ReplaceVertices{0, positions, {}, scene::UpdateMode::kAuto}},
                   {scene::RebuildPlace::kInBackground})
          .value()
          .scene;
  const auto order = scene::better_tree(*second, 0);
  ASSERT_TRUE(order.has_value());
  const auto outcome =
      scene::replace_tree(*second, 0, blas::Blas::build(order->mesh, order->options).value()).value();
  const ScenePtr better = std::get<ScenePtr>(outcome);
  {
    const auto archive = open();
    const std::int64_t key = archive->create("a", {}, *first, 1).value();
    ASSERT_TRUE(archive->append(key, *first, second));
    archive->tree_replaced(key, better);
    archive->finish(kLong);
  }
  const Life life = restarted();
  EXPECT_EQ(life.trees.found, 1U);
  EXPECT_TRUE(tree_of(*life.scene) == tree_of(*better)) << "though both are there";
  EXPECT_FALSE(scene::better_tree(*life.scene, 0).has_value());
}

TEST_F(KeptTreesTest, trees_that_no_scene_has_go_but_only_when_all_scenes_are_known) {
  const ScenePtr scene = sphere();
  store(scene);
  {
    const auto archive = open();  // ends before its scenes are restored
    archive->finish(kLong);
  }
  EXPECT_EQ(files().size(), 1U);
  {
    const auto archive = open();
    const SceneRow row = archive->scenes().value().at(0);
    const ScenePtr kept = archive->restore(row, {}).value();
    archive->served(row.key, kept);
    const std::int64_t copy = archive->create("b", {}, *kept, 2).value();
    archive->served(copy, kept);
    archive->all_restored();
    ASSERT_TRUE(archive->erase(row.key));
    archive->finish(kLong);
    EXPECT_EQ(files().size(), 1U) << "the copy has the same tree";
  }
  {
    const auto archive = open();
    const SceneRow row = archive->scenes().value().at(0);
    const ScenePtr kept = archive->restore(row, {}).value();
    archive->served(row.key, kept);
    archive->all_restored();
    ASSERT_TRUE(archive->erase(row.key));
    archive->finish(kLong);
  }
  EXPECT_TRUE(files().empty());
}

TEST_F(KeptTreesTest, a_folder_that_cannot_be_used_costs_the_trees_alone) {
  std::ofstream(folder_ / "structures") << "a file";
  const ScenePtr scene = sphere();
  EXPECT_EQ(store(scene).kept, 0U);
  test::expect_same_scene(*scene, *restarted().scene);
  fs::remove(folder_ / "structures");
  const auto archive = open();
  fs::remove_all(folder_ / "structures");
  archive->served(archive->scenes().value().at(0).key, scene);
  archive->finish(kLong);
  EXPECT_EQ(archive->counts().trees.failures, 1U);
  EXPECT_EQ(archive->counts().failures, 0U) << "the scene is stored";
}

TEST_F(KeptTreesTest, an_end_in_a_hurry_keeps_nothing_and_breaks_nothing) {
  options_.trees.rest = std::chrono::hours(1);
  const ScenePtr first = sphere(), second = moved(*first, 0.1F);
  {
    const auto archive = open();
    const std::int64_t key = archive->create("a", {}, *first, 1).value();
    ASSERT_TRUE(archive->append(key, *first, second));
    archive->finish(std::chrono::milliseconds(-1));
    EXPECT_EQ(archive->counts().trees.kept, 0U);
  }
  test::expect_same_scene(*second, *restarted().scene);
}

}  // namespace
}  // namespace gridcast::server::store
