#include "core/math/memory_pool.h"

#include <cstring>
#include <set>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace gridcast {
namespace {

#if defined(__SANITIZE_ADDRESS__)
constexpr bool kKeeps = false;  // or AddressSanitizer would not see who still uses what was given back
#else
constexpr bool kKeeps = true;
#endif

TEST(MemoryPool, hands_out_again_what_was_given_back) {
  MemoryPool pool(1000);
  void* const first = pool.take();
  void* const second = pool.take();
  EXPECT_NE(first, second);
  pool.give_back(first);
  EXPECT_EQ(pool.kept_bytes(), kKeeps ? 1000U : 0U);
  void* const third = pool.take();
  if (kKeeps) {
    EXPECT_EQ(third, first);
  }
  pool.give_back(third);
  pool.give_back(second);
}

TEST(MemoryPool, keeps_no_more_than_it_says) {
  constexpr std::size_t kBytes = std::size_t(3) << 20;
  MemoryPool pool(kBytes);
  std::vector<void*> all(10);
  for (void*& memory : all) memory = pool.take();
  EXPECT_EQ(std::set<void*>(all.begin(), all.end()).size(), all.size());
  for (void* memory : all) pool.give_back(memory);
  EXPECT_EQ(pool.kept_bytes(), kKeeps ? MemoryPool::kKeptBytes / kBytes * kBytes : 0U);
}

TEST(MemoryPool, gives_no_piece_to_two_threads) {
  MemoryPool pool(64);
  const auto work = [&](unsigned char mark) {
    for (int round = 0; round < 2000; ++round) {
      void* pieces[4];
      for (void*& piece : pieces) std::memset(piece = pool.take(), mark, 64);
      for (void* piece : pieces)
        for (int byte = 0; byte < 64; ++byte) ASSERT_EQ(static_cast<unsigned char*>(piece)[byte], mark);
      for (void* piece : pieces) pool.give_back(piece);
    }
  };
  std::thread other(work, 1);
  work(2);
  other.join();
}

}  // namespace
}  // namespace gridcast
