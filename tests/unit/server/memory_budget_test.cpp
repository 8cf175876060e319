#include "server/memory_budget.h"

#include <vector>

#include <gtest/gtest.h>

namespace gridcast::server {
namespace {

using Level = MemoryBudget::Level;

TEST(MemoryBudget, counts_what_the_process_holds) {
  const MemoryBudget budget(0);
  const std::uint64_t before = budget.used();
  EXPECT_GT(before, std::uint64_t(1) << 20);
  constexpr std::size_t kBytes = std::size_t(64) << 20;
  const std::vector<char> block(kBytes, 1);
  EXPECT_GE(budget.used() + (std::uint64_t(8) << 20), before + block.size());
}

TEST(MemoryBudget, levels_are_shares_of_it) {
  constexpr std::uint64_t kBytes = std::uint64_t(1) << 44;
  const MemoryBudget budget(kBytes);
  const auto at = [&](double share) { return budget.level(std::uint64_t(share * double(kBytes))); };
  EXPECT_EQ(at(0.0), Level::kFree);
  EXPECT_EQ(at(0.84), Level::kFree);
  EXPECT_EQ(at(0.86), Level::kTight);
  EXPECT_EQ(at(0.94), Level::kTight);
  EXPECT_EQ(at(0.96), Level::kFull);
  EXPECT_EQ(MemoryBudget(1).level(), Level::kFull);
  EXPECT_EQ(MemoryBudget(0).level(kBytes), Level::kFree) << "no budget";
}

TEST(MemoryBudget, relief_comes_before_a_refusal) {
  constexpr std::uint64_t kBytes = std::uint64_t(1) << 44;
  MemoryBudget budget(kBytes);
  int relieved = 0;
  budget.set_relief([&] { ++relieved; });
  const auto at = [&](double share) { return budget.level(std::uint64_t(share * double(kBytes))); };
  EXPECT_EQ(at(0.69), Level::kFree);
  EXPECT_EQ(relieved, 0);
  EXPECT_EQ(at(0.71), Level::kFree);
  EXPECT_EQ(relieved, 1);
  EXPECT_EQ(at(0.96), Level::kFull);
  EXPECT_EQ(relieved, 2);
}

TEST(MemoryBudget, what_relief_frees_counts_no_more) {
  std::vector<char> kept(std::size_t(256) << 20, 1);
  MemoryBudget budget(0);
  const std::uint64_t with_it = budget.used();
  MemoryBudget tight(with_it + (std::uint64_t(16) << 20));
  EXPECT_NE(tight.level(), Level::kFree);
  tight.set_relief([&] { std::vector<char>().swap(kept); });
  EXPECT_EQ(tight.level(), Level::kFree);
}

TEST(MemoryBudget, the_default_is_no_more_than_the_machine_has) {
  EXPECT_GT(available_memory_bytes(), std::uint64_t(1) << 26);
  EXPECT_LT(available_memory_bytes(), std::uint64_t(1) << 50);
}

}  // namespace
}  // namespace gridcast::server
