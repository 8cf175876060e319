// Files of built trees: what is not what was put is noticed, whatever happened to it.

#include "server/store/tree_files.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>

namespace gridcast::server::store {
namespace {

namespace fs = std::filesystem;

class TreeFilesTest : public testing::Test {
 protected:
  TreeFilesTest() {
    std::string name = (fs::temp_directory_path() / "gridcast_trees_XXXXXX").string();
    root_ = ::mkdtemp(name.data());
  }
  ~TreeFilesTest() override { fs::remove_all(root_); }

  [[nodiscard]] std::string folder() const { return (root_ / "structures").string(); }
  [[nodiscard]] std::size_t file_count() const {
    return std::size_t(std::distance(fs::directory_iterator(folder()), fs::directory_iterator()));
  }
  static std::string content(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static void overwrite(const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
  }

  fs::path root_;
};

Digest key_of(const std::string& name) {
  return sha256(name);
}

TEST_F(TreeFilesTest, what_was_put_comes_back_here_and_in_a_later_process) {
  TreeFiles files(folder(), 1 << 20);
  ASSERT_TRUE(files.open());
  EXPECT_EQ(files.get(key_of("a")).error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(files.put(key_of("a"), "a tree"));
  ASSERT_TRUE(files.put(key_of("b"), ""));
  EXPECT_EQ(files.get(key_of("a"))->tree(), "a tree");
  TreeFiles later(folder(), 1 << 20);
  ASSERT_TRUE(later.open());
  EXPECT_TRUE(later.contains(key_of("a")));
  EXPECT_EQ(later.get(key_of("a"))->tree(), "a tree");
  EXPECT_EQ(later.get(key_of("b"))->tree(), "");
  EXPECT_EQ(later.bytes(), files.bytes());
  later.remove(key_of("a"));
  EXPECT_FALSE(later.contains(key_of("a")));
  EXPECT_EQ(file_count(), 1U);
  ASSERT_TRUE(later.put(key_of("b"), "another"));
  EXPECT_EQ(later.get(key_of("b"))->tree(), "another");
  later.keep_only({});
  EXPECT_EQ(later.bytes(), 0U);
  EXPECT_EQ(file_count(), 0U);
}

TEST_F(TreeFilesTest, a_turned_bit_anywhere_and_a_missing_end_are_noticed) {
  TreeFiles files(folder(), 1 << 20);
  ASSERT_TRUE(files.open());
  ASSERT_TRUE(files.put(key_of("a"), std::string(300, 'x')));
  const std::string path = files.path_of(key_of("a"));
  const std::string sound = content(path);
  for (std::size_t at = 0; at < sound.size(); ++at) {
    std::string bytes = sound;
    bytes[at] = char(bytes[at] ^ char(1U << (at % 8)));
    overwrite(path, bytes);
    const auto got = files.get(key_of("a"));
    ASSERT_FALSE(got.ok()) << at;
    EXPECT_NE(got.error().message.find(path), std::string::npos) << "the file is named";
    overwrite(path, sound.substr(0, at));
    ASSERT_FALSE(files.get(key_of("a")).ok()) << at;
  }
  overwrite(path, sound + "x");
  EXPECT_FALSE(files.get(key_of("a")).ok());
  overwrite(path, sound);
  EXPECT_TRUE(files.get(key_of("a")).ok());
}

TEST_F(TreeFilesTest, a_file_under_the_name_of_another_tree_and_one_of_another_version_are_told) {
  TreeFiles files(folder(), 1 << 20);
  ASSERT_TRUE(files.open());
  ASSERT_TRUE(files.put(key_of("a"), "a tree"));
  ASSERT_TRUE(files.put(key_of("b"), "b tree"));
  fs::copy_file(files.path_of(key_of("a")), files.path_of(key_of("b")), fs::copy_options::overwrite_existing);
  EXPECT_EQ(files.get(key_of("b")).error().code, ErrorCode::kInvalidFile);
  std::string newer = content(files.path_of(key_of("a")));
  newer[4] = 9;
  overwrite(files.path_of(key_of("a")), newer);
  EXPECT_EQ(files.get(key_of("a")).error().code, ErrorCode::kUnsupported);
}

TEST_F(TreeFilesTest, the_ones_used_longest_ago_make_room) {
  const std::string tree(1000, 't');
  TreeFiles files(folder(), 3500);
  ASSERT_TRUE(files.open());
  for (const char* name : {"a", "b", "c"}) {
    ASSERT_TRUE(files.put(key_of(name), tree));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ASSERT_TRUE(files.get(key_of("a")).ok());
  ASSERT_TRUE(files.put(key_of("d"), tree));
  EXPECT_TRUE(files.contains(key_of("a")));
  EXPECT_FALSE(files.contains(key_of("b")));
  EXPECT_LE(files.bytes(), 3500U);
  EXPECT_EQ(files.put(key_of("e"), std::string(4000, 't')).error().code, ErrorCode::kLimitExceeded);
  EXPECT_TRUE(files.contains(key_of("a"))) << "what never fits costs nothing";

  // A later process knows by the times of the files; `c` was used before `a`.
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ASSERT_TRUE(files.get(key_of("d")).ok());
  TreeFiles smaller(folder(), 2300);
  ASSERT_TRUE(smaller.open());
  EXPECT_FALSE(smaller.contains(key_of("c")));
  EXPECT_TRUE(smaller.contains(key_of("a")));
  EXPECT_TRUE(smaller.contains(key_of("d")));
}

TEST_F(TreeFilesTest, what_a_crash_left_goes_and_what_cannot_be_written_is_told) {
  TreeFiles files(folder(), 1 << 20);
  ASSERT_TRUE(files.open());
  overwrite(folder() + "/tmp-3", "half");
  overwrite(folder() + "/readme", "not ours");
  TreeFiles later(folder(), 1 << 20);
  ASSERT_TRUE(later.open());
  EXPECT_FALSE(fs::exists(folder() + "/tmp-3"));
  EXPECT_TRUE(fs::exists(folder() + "/readme"));
  EXPECT_EQ(later.bytes(), 0U);

  fs::remove_all(folder());
  EXPECT_EQ(later.put(key_of("a"), "a tree").error().code, ErrorCode::kIo);
  EXPECT_FALSE(later.contains(key_of("a")));
  overwrite(folder(), "a file");
  TreeFiles none(folder(), 1 << 20);
  EXPECT_EQ(none.open().error().code, ErrorCode::kIo);
}

TEST(TreeKey, changes_with_all_that_a_tree_is_built_from) {
  const blas::BuildOptions options;
  std::set<Digest> keys{tree_key(sha256("mesh"), options), tree_key(sha256("other"), options)};
  blas::BuildOptions other = options;
  other.kind = blas::StructureKind::kBvh;
  keys.insert(tree_key(sha256("mesh"), other));
  other = options;
  other.split = blas::BvhSplit::kMedian;
  keys.insert(tree_key(sha256("mesh"), other));
  other = options;
  other.spatial = blas::SpatialSplits::kNever;
  keys.insert(tree_key(sha256("mesh"), other));
  other = options;
  other.motion = blas::MeshMotion::kDeforms;
  keys.insert(tree_key(sha256("mesh"), other));
  other = options;
  other.quality = blas::BuildQuality::kFast;
  keys.insert(tree_key(sha256("mesh"), other));
  EXPECT_EQ(keys.size(), 7U);
}

}  // namespace
}  // namespace gridcast::server::store
