#pragma once
// Data that is not in the repository. A test that needs it skips with a printed reason when it is absent.

#include <filesystem>
#include <optional>
#include <string>

#include <gtest/gtest.h>

namespace gridcast::test {

/// A file or folder below $GRIDCAST_ASSETS, or below ../shared/assets beside the repository.
std::optional<std::filesystem::path> shared_asset(const std::string& relative);

/// A file of Debian's assimp-testmodels package, relative to its models folder.
std::optional<std::filesystem::path> assimp_model(const std::string& relative);

}  // namespace gridcast::test

// NOLINTBEGIN(bugprone-macro-parentheses): `variable` is declared here.
/// Sets `variable` to the path, or skips the test saying what is missing.
#define GRIDCAST_REQUIRE_ASSET(variable, lookup)                                       \
  const auto variable##_found = (lookup);                                              \
  if (!variable##_found) GTEST_SKIP() << "test data not on this machine: " << #lookup; \
  const std::filesystem::path& variable = *variable##_found
// NOLINTEND(bugprone-macro-parentheses)
