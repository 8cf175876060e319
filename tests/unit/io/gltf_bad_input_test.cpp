#include <fstream>
#include <sstream>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/assets.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

constexpr rlim_t kMaxMemoryBytes = rlim_t(1) << 30;
constexpr rlim_t kMaxCpuSeconds = kSanitized ? 20 : 2;

enum Outcome : int { kLoaded = 10, kRefused = 11, kRefusedWithoutWords = 12, kDoorsDisagree = 13 };

void limit(int resource, rlim_t value) {
  const rlimit both{value, value};
  setrlimit(resource, &both);
}

/// Imports the file by its path, and its bytes from memory.
Outcome import_both_ways(const std::filesystem::path& path) {
  const auto from_file = io::import_gltf_file(path);
  std::ifstream stream(path, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  const auto from_memory = io::import_gltf(std::as_bytes(std::span(text)));
  // From memory less is allowed, never more.
  if (from_memory.ok() && !from_file.ok()) return kDoorsDisagree;
  if (from_file.ok()) return kLoaded;
  return from_file.error().message.empty() ? kRefusedWithoutWords : kRefused;
}

/// The outcome, or what ended the process: crashes and exhausted limits stay in a child.
std::string import_in_child(const std::filesystem::path& path) {
  const pid_t child = fork();
  if (child == 0) {
    if (!kSanitized) limit(RLIMIT_AS, kMaxMemoryBytes);
    limit(RLIMIT_CPU, kMaxCpuSeconds);
    limit(RLIMIT_CORE, 0);
    _exit(import_both_ways(path));
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFSIGNALED(status)) return "ended by signal " + std::to_string(WTERMSIG(status));
  switch (WEXITSTATUS(status)) {
    case kLoaded:
      return "loaded";
    case kRefused:
      return "refused";
    case kRefusedWithoutWords:
      return "refused without a message";
    case kDoorsDisagree:
      return "loaded from memory but not from its file";
    default:
      return "exit code " + std::to_string(WEXITSTATUS(status));
  }
}

struct Row {
  std::string file, expectation, reason;
};

std::vector<Row> read_manifest(const std::filesystem::path& path) {
  std::ifstream stream(path);
  std::vector<Row> rows;
  std::string line;
  std::getline(stream, line);  // column names
  while (std::getline(stream, line)) {
    std::istringstream cells(line);
    Row row;
    std::getline(cells, row.file, '\t');
    std::getline(cells, row.expectation, '\t');
    std::getline(cells, row.reason, '\t');
    rows.push_back(std::move(row));
  }
  return rows;
}

TEST(GltfBadInput, every_listed_file_is_refused_or_safe_within_one_gibibyte_and_two_seconds) {
  GRIDCAST_REQUIRE_ASSET(manifest, shared_asset("bad/MANIFEST.tsv"));
  const auto rows = read_manifest(manifest);
  ASSERT_GT(rows.size(), 300U);
  int rejected = 0;
  for (const Row& row : rows) {
    const std::string outcome = import_in_child(manifest.parent_path() / row.file);
    if (row.expectation == "reject") {
      EXPECT_EQ(outcome, "refused") << row.file << ": " << row.reason;
      ++rejected;
    } else {
      EXPECT_TRUE(outcome == "loaded" || outcome == "refused") << row.file << ": " << outcome;
    }
  }
  std::cout << rows.size() << " files, " << rejected << " to be refused\n";
}

TEST(GltfBadInput, the_bad_files_of_the_assimp_package_are_refused) {
  GRIDCAST_REQUIRE_ASSET(models, assimp_model("glTF2"));
  for (const char* file :
       {"IndexOutOfRange/IndexOutOfRange.gltf", "RecursiveNodes/RecursiveNodes.gltf",
        "BoxWithInfinites-glTF-Binary/BoxWithInfinites.glb", "MissingBin/BoxTextured.gltf",
        "wrongTypes/badArray.gltf", "wrongTypes/badNumber.gltf", "wrongTypes/badObject.gltf",
        "wrongTypes/badString.gltf", "TestNoRootNode/NoScene.gltf"}) {
    if (!std::filesystem::exists(models / file)) continue;
    EXPECT_EQ(import_in_child(models / file), "refused") << file;
  }
}

TEST(GltfBadInput, every_gltf_file_of_the_assimp_package_is_survived) {
  GRIDCAST_REQUIRE_ASSET(models, assimp_model(""));
  int loaded = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(models)) {
    const auto extension = entry.path().extension();
    if (extension != ".gltf" && extension != ".glb") continue;
    const std::string outcome = import_in_child(entry.path());
    EXPECT_TRUE(outcome == "loaded" || outcome == "refused") << entry.path() << ": " << outcome;
    loaded += outcome == "loaded" ? 1 : 0;
  }
  EXPECT_GE(loaded, 30);
}

}  // namespace
}  // namespace gridcast::test
