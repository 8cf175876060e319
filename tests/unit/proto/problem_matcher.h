#pragma once
// Shared by the tests of proto: what a refused request must look like.

#include <string>

#include <gtest/gtest.h>

#include "proto/parsed.h"

namespace gridcast::proto {

/// `invalid_json 400 /origins/0`, or `ok`: compares as one string, prints well.
template <class T>
std::string outcome(const Parsed<T>& parsed) {
  if (parsed.ok()) return "ok";
  const ProblemKind& kind = describe(parsed.problem().code);
  return std::string(kind.name) + " " + std::to_string(kind.status) + " " + parsed.problem().pointer;
}

}  // namespace gridcast::proto
