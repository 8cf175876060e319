#include "core/math/instruction_set.h"

#include <algorithm>
#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

namespace gridcast {
namespace {

/// Each test ends with what the program was started with.
class InstructionSet : public testing::Test {
 protected:
  void TearDown() override { ASSERT_TRUE(limit_instruction_set(before_)); }
  const std::string before_{instruction_set()};
};

TEST_F(InstructionSet, EveryOneOfThisMachineCanBeUsed) {
  const auto sets = instruction_sets();
  ASSERT_FALSE(sets.empty());
  for (const std::string_view name : sets) {
    ASSERT_TRUE(limit_instruction_set(name)) << name;
    EXPECT_EQ(instruction_set(), name);
    EXPECT_EQ(instruction_sets(), sets) << "what there is does not depend on the limit";
  }
#if defined(__x86_64__)
  EXPECT_EQ(sets.back(), "scalar");
  const auto has = [&](std::string_view name) {
    return std::find(sets.begin(), sets.end(), name) != sets.end();
  };
  EXPECT_EQ(has("sse4"), __builtin_cpu_supports("sse4.2") != 0);
#endif
}

TEST_F(InstructionSet, NativeLiftsTheLimit) {
  for (const std::string_view name : {"native", "auto", ""}) {
    ASSERT_TRUE(limit_instruction_set(instruction_sets().back()));
    ASSERT_TRUE(limit_instruction_set(name));
    EXPECT_EQ(instruction_set(), instruction_sets().front());
  }
}

TEST_F(InstructionSet, AnUnknownNameIsRefusedWithWhatThereIs) {
  for (const std::string_view name : {"avx9000", "AVX2", "sse4 ", "-1"}) {
    const Status status = limit_instruction_set(name);
    ASSERT_FALSE(status) << name;
    EXPECT_EQ(status.error().code, ErrorCode::kUnsupported);
    for (const std::string_view known : instruction_sets())
      EXPECT_NE(status.error().message.find(known), std::string::npos) << status.error().message;
    EXPECT_EQ(instruction_set(), before_) << "a refusal changes nothing";
  }
}

TEST_F(InstructionSet, TheEnvironmentNamesIt) {
  const char* before = std::getenv("GRIDCAST_ISA");
  const std::string kept = before == nullptr ? "" : before;
  const std::string narrowest(instruction_sets().back());
  setenv("GRIDCAST_ISA", narrowest.c_str(), 1);
  EXPECT_TRUE(limit_instruction_set_by_environment());
  EXPECT_EQ(instruction_set(), narrowest);
  setenv("GRIDCAST_ISA", "nonsense", 1);
  const Status refused = limit_instruction_set_by_environment();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "GRIDCAST_ISA");
  setenv("GRIDCAST_ISA", kept.c_str(), 1);
}

}  // namespace
}  // namespace gridcast
