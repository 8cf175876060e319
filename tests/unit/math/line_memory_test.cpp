#include "core/math/line_memory.h"

#include <cstring>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

namespace gridcast {
namespace {

TEST(LineMemory, begins_at_a_cache_line_and_is_all_there) {
  std::vector<void*> pieces;
  for (std::size_t bytes = 0; bytes < 300; ++bytes) {
    pieces.push_back(allocate_lines(bytes));
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(pieces.back()) % kCacheLineBytes, 0U);
    std::memset(pieces.back(), int(bytes), bytes);
  }
  for (std::size_t bytes = 0; bytes < 300; ++bytes) {
    for (std::size_t i = 0; i < bytes; ++i)
      ASSERT_EQ(static_cast<unsigned char*>(pieces[bytes])[i], static_cast<unsigned char>(bytes));
    free_lines(pieces[bytes]);
  }
}

TEST(LineMemory, more_than_there_can_be_throws) {
  EXPECT_THROW((void)allocate_lines(std::numeric_limits<std::size_t>::max() - 8), std::bad_alloc);
}

}  // namespace
}  // namespace gridcast
