#include "core/blas/morton_ranges.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace gridcast::blas {
namespace {

/// Keys of these codes, numbered in their order.
MortonKeys keys_of(const std::vector<std::uint64_t>& codes) {
  MortonKeys keys(codes.size());
  for (std::size_t i = 0; i < keys.size(); ++i) keys[i] = codes[i] << kMortonNumberBits | i;
  return keys;
}

TEST(MortonRanges, a_split_is_where_the_highest_differing_bit_turns_to_one) {
  EXPECT_EQ(morton_split(keys_of({0b0000, 0b0001, 0b0011, 0b0100})), 3U);
  EXPECT_EQ(morton_split(keys_of({0b1000, 0b1100})), 1U);
  EXPECT_EQ(morton_split(keys_of({0b1000, 0b1001, 0b1001, 0b1001})), 1U);
  EXPECT_EQ(morton_split(keys_of({5, 5, 5, 5, 5})), 2U) << "numbers do not count";
}

TEST(MortonRanges, few_keys_are_split_where_many_are) {
  test::Random random(test::seed_or(74));
  for (int round = 0; round < 200; ++round) {
    std::vector<std::uint64_t> codes(2 + random.below(300));
    for (std::uint64_t& code : codes) code = random.bits() % (std::uint64_t(1) << (1 + round % 33));
    std::sort(codes.begin(), codes.end());
    const std::uint64_t differing = codes.front() ^ codes.back();
    const std::size_t split = morton_split(keys_of(codes));
    if (differing == 0) {
      EXPECT_EQ(split, codes.size() / 2);
      continue;
    }
    ASSERT_TRUE(split > 0 && split < codes.size());
    EXPECT_GT((codes[split - 1] ^ codes[split]) * 2, differing) << "the same highest bit";
  }
}

TEST(MortonRanges, ranges_follow_each_other_and_are_no_longer_than_asked) {
  test::Random random(test::seed_or(75));
  for (const std::size_t count : {0, 1, 7, 1000, 50000}) {
    std::vector<std::uint64_t> codes(count);
    for (std::uint64_t& code : codes) code = random.below(20000);
    std::sort(codes.begin(), codes.end());
    const MortonKeys keys = keys_of(codes);
    for (const std::uint32_t largest : {1U, 48U, 64U}) {
      std::uint32_t next = 0;
      for (const KeyRange& range : morton_ranges(keys, largest)) {
        ASSERT_EQ(range.begin, next);
        ASSERT_TRUE(range.size() >= 1 && range.size() <= largest);
        next = range.end;
      }
      EXPECT_EQ(next, count);
    }
  }
}

}  // namespace
}  // namespace gridcast::blas
