#include <atomic>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/io/image.h"

namespace gridcast::io {
namespace {

namespace fs = std::filesystem;

std::vector<std::byte> bytes_of(const std::string& text) {
  std::vector<std::byte> bytes(text.size());
  std::memcpy(bytes.data(), text.data(), text.size());
  return bytes;
}

/// A folder of its own that goes away with the test.
class FileTest : public testing::Test {
 protected:
  FileTest() {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / (std::string(test->name()).append(std::to_string(getpid())));
    fs::create_directories(folder_);
  }
  ~FileTest() override { fs::remove_all(folder_); }

  [[nodiscard]] std::size_t entries() const {
    return std::size_t(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  fs::path folder_;
};

TEST_F(FileTest, what_was_written_is_read) {
  const std::vector<std::byte> bytes = bytes_of("hello");
  ASSERT_TRUE(write_file(folder_ / "a", bytes).ok());
  EXPECT_EQ(read_file(folder_ / "a", 5).value(), bytes);
  EXPECT_EQ(entries(), 1U);
}

TEST_F(FileTest, an_existing_file_is_replaced_as_a_whole) {
  ASSERT_TRUE(write_file(folder_ / "a", bytes_of("a long first version")).ok());
  ASSERT_TRUE(write_file(folder_ / "a", bytes_of("short")).ok());
  EXPECT_EQ(read_file(folder_ / "a", 100).value(), bytes_of("short"));
  EXPECT_EQ(entries(), 1U);
}

TEST_F(FileTest, an_empty_file_is_fine) {
  ASSERT_TRUE(write_file(folder_ / "a", {}).ok());
  EXPECT_TRUE(read_file(folder_ / "a", 0).value().empty());
}

TEST_F(FileTest, readers_never_see_half_a_file) {
  const std::string big(1 << 20, 'x'), other(1 << 20, 'y');
  ASSERT_TRUE(write_file(folder_ / "a", bytes_of(big)).ok());
  std::atomic<bool> stop{false};
  std::thread writer([&] {
    for (int i = 0; i < 20; ++i) (void)write_file(folder_ / "a", bytes_of(i % 2 == 0 ? other : big));
    stop = true;
  });
  int torn = 0;
  while (!stop) {
    const auto read = read_file(folder_ / "a", 1 << 20);
    if (!read || (*read != bytes_of(big) && *read != bytes_of(other))) ++torn;
  }
  writer.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(entries(), 1U);
}

TEST_F(FileTest, a_missing_folder_is_not_found_and_leaves_nothing) {
  const Status status = write_file(folder_ / "none" / "a", bytes_of("x"));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(entries(), 0U);
}

TEST_F(FileTest, a_folder_in_the_way_is_an_error_and_leaves_no_temporary) {
  fs::create_directories(folder_ / "a");
  const Status status = write_file(folder_ / "a", bytes_of("x"));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_EQ(entries(), 1U);
}

TEST_F(FileTest, a_missing_file_is_not_found) {
  EXPECT_EQ(read_file(folder_ / "a", 10).error().code, ErrorCode::kNotFound);
}

TEST_F(FileTest, a_file_above_the_limit_is_refused) {
  ASSERT_TRUE(write_file(folder_ / "a", bytes_of("123456")).ok());
  EXPECT_EQ(read_file(folder_ / "a", 5).error().code, ErrorCode::kLimitExceeded);
  EXPECT_TRUE(read_file(folder_ / "a", 6).ok());
}

TEST_F(FileTest, folders_and_pipes_are_not_read) {
  EXPECT_EQ(read_file(folder_, 10).error().code, ErrorCode::kInvalidArgument);
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(read_file(folder_ / "pipe", 10).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace gridcast::io
