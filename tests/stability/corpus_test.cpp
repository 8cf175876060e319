// Every case that ever failed, or that others found, is asked again for ever.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "tests/stability/subject.h"

namespace gridcast::stability {
namespace {

std::vector<std::filesystem::path> corpus_files() {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(options().corpus))
    if (entry.path().extension() == ".txt") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

TEST(Stability, Corpus) {
  const auto files = corpus_files();
  ASSERT_FALSE(files.empty()) << "no case in " << options().corpus;
  Row row(Row::kCorpus, 0);
  for (const std::filesystem::path& path : files) {
    SCOPED_TRACE(path);
    std::ifstream in(path);
    const CaseFile file = read_case(in);
    ASSERT_FALSE(file.shots.empty());
    const Subject subject(file.scene);
    (void)subject.ask(row, file.shots);
  }
}

TEST(Stability, CasesAreReadAsTheyWereWritten) {
  CaseFile file;
  file.what = "a bit of everything";
  file.source = "made here";
  file.scene.meshes = {generated("box -1 -1 -1 1 1 1 | scale 1 0.1 1"),
                       given(*generated("soup 5 3 0.2").mesh)};
  file.scene.instances = {{0, {}},
                          {1, {Mat3d(0.1, 0, 0, 0, -3, 0.5, 0, 0, 7), Vec3d(1.0 / 3.0, -1e300, 5e-324)}}};
  const Ray ray{{0.1, -0.0, 1e-310}, {1e-200, 3, -1}, -1.0 / 7.0};
  file.shots = {{ray, {1, 2}, Expectation::hit({1, 4}, 1.0 / 3.0, 0x1p-40)},
                {ray, {}, Expectation::miss()},
                {ray, {}, Expectation::invalid()},
                {ray, {}, Expectation::hit()},
                {ray, {}, Expectation::hit({1, 4})},
                {ray, {}, {}}};
  std::stringstream text, again;
  write_case(text, file);
  const std::string first = text.str();
  const CaseFile read = read_case(text);
  write_case(again, read);
  EXPECT_EQ(first, again.str());
  EXPECT_EQ(read.scene.meshes[1].mesh->positions, file.scene.meshes[1].mesh->positions);
  EXPECT_EQ(read.shots[0].ray.origin, ray.origin);
  EXPECT_EQ(read.shots[0].ray.tfar, ray.tfar);
  std::istringstream wrong("gridcast-case 1\nray 1 2 3\n");
  EXPECT_THROW((void)read_case(wrong), std::invalid_argument);
}

}  // namespace
}  // namespace gridcast::stability
