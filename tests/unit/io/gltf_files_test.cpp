#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/support/gltf_builder.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

namespace fs = std::filesystem;

/// A folder of its own, gone at the end: base/ holds the documents, outside.bin lies beside it.
class GltfFiles : public testing::Test {
 protected:
  GltfFiles() : root_(fs::temp_directory_path() / ("gridcast_gltf_" + std::to_string(getpid()))) {
    fs::create_directories(base() / "deep er");
    const GltfBuilder builder = triangle_document();
    for (const fs::path& path : {base() / "data.bin", base() / "deep er" / "data.bin", root_ / "outside.bin"})
      write(path, builder.bin);
  }
  ~GltfFiles() override { fs::remove_all(root_); }

  [[nodiscard]] fs::path base() const { return root_ / "base"; }
  [[nodiscard]] fs::path outside() const { return root_ / "outside.bin"; }
  static void write(const fs::path& path, const std::vector<std::byte>& bytes) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  }
  /// Imports a document whose buffer has this URI.
  [[nodiscard]] Result<scene::SceneData> import_uri(const std::string& uri) const {
    GltfBuilder builder = triangle_document();
    builder.document["buffers"] = {{{"byteLength", builder.bin.size()}, {"uri", uri}}};
    write(base() / "scene.gltf", to_bytes(builder.document.dump()));
    return io::import_gltf_file(base() / "scene.gltf");
  }

 private:
  fs::path root_;
};

TEST_F(GltfFiles, files_in_the_folder_and_below_are_read) {
  for (const char* uri : {"data.bin", "./data.bin", "deep%20er/data.bin", "deep er/data.bin", "%64ata.bin"})
    EXPECT_TRUE(import_uri(uri).ok()) << uri;
}

TEST_F(GltfFiles, every_way_out_of_the_folder_is_refused) {
  const std::string absolute = outside().string();
  for (const std::string& uri : {std::string("../outside.bin"),
                                 std::string("%2e%2e/outside.bin"),
                                 std::string("%2E./outside.bin"),
                                 std::string("deep er/../../outside.bin"),
                                 std::string("..%2foutside.bin"),
                                 std::string("..\\outside.bin"),
                                 std::string("..%5coutside.bin"),
                                 absolute,
                                 "file://" + absolute,
                                 "file:" + absolute,
                                 "FILE://" + absolute,
                                 "//localhost" + absolute,
                                 std::string("http://127.0.0.1/data.bin"),
                                 std::string("https://127.0.0.1/data.bin"),
                                 std::string("ftp:data.bin"),
                                 std::string("C:/data.bin"),
                                 std::string("data.bin%00.png"),
                                 std::string("%"),
                                 std::string("%zz"),
                                 std::string(""),
                                 std::string("."),
                                 std::string("deep er"),
                                 std::string("missing.bin"),
                                 std::string("%c0%ae%c0%ae/outside.bin"),
                                 std::string("/dev/zero"),
                                 std::string("/proc/self/environ"),
                                 std::string("data.bin/../../outside.bin"),
                                 std::string("data.bin?query"),
                                 std::string("data.bin#fragment")}) {
    const auto scene = import_uri(uri);
    ASSERT_FALSE(scene.ok()) << uri;
    EXPECT_EQ(scene.error().message.find(absolute), std::string::npos) << "the message tells a path";
  }
}

TEST_F(GltfFiles, a_link_that_leaves_the_folder_is_refused_and_one_that_stays_is_read) {
  fs::create_symlink(outside(), base() / "out.bin");
  fs::create_directory_symlink(outside().parent_path(), base() / "up");
  fs::create_symlink(base() / "data.bin", base() / "in.bin");
  EXPECT_FALSE(import_uri("out.bin").ok());
  EXPECT_FALSE(import_uri("up/outside.bin").ok());
  EXPECT_TRUE(import_uri("in.bin").ok());
}

TEST_F(GltfFiles, a_short_file_is_refused_and_a_longer_one_is_read) {
  auto bytes = triangle_document().bin;
  bytes.push_back(std::byte{0});
  write(base() / "data.bin", bytes);
  EXPECT_TRUE(import_uri("data.bin").ok());
  bytes.resize(35);
  write(base() / "data.bin", bytes);
  EXPECT_EQ(import_uri("data.bin").error().where, "/buffers/0");
}

TEST_F(GltfFiles, from_memory_no_file_is_read) {
  GltfBuilder builder = triangle_document();
  builder.document["buffers"] = {
      {{"byteLength", builder.bin.size()}, {"uri", (base() / "data.bin").string()}}};
  EXPECT_EQ(import_error(builder.glb()).where, "/buffers/0/uri");
  builder.document["buffers"][0]["uri"] = "data.bin";
  EXPECT_EQ(import_error(builder.glb()).where, "/buffers/0/uri");
}

TEST_F(GltfFiles, data_uris_of_other_types_or_with_other_letters_are_refused) {
  const std::string good = to_base64(triangle_document().bin);
  EXPECT_TRUE(import_uri("data:application/gltf-buffer;base64," + good).ok());
  EXPECT_FALSE(import_uri("data:text/html;base64," + good).ok());
  EXPECT_FALSE(import_uri("data:application/octet-stream," + good).ok());
  EXPECT_FALSE(import_uri("data:application/octet-stream;base64,*" + good).ok());
  EXPECT_FALSE(import_uri("data:application/octet-stream;base64," + good.substr(0, 20)).ok());
}

TEST_F(GltfFiles, what_is_not_a_file_is_refused) {
  EXPECT_EQ(io::import_gltf_file(base() / "nothing.glb").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(io::import_gltf_file(base()).error().code, ErrorCode::kIo);
  EXPECT_EQ(io::import_gltf_file("/dev/zero").error().code, ErrorCode::kIo);
}

}  // namespace
}  // namespace gridcast::test
