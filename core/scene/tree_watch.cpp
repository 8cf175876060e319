#include "core/scene/tree_watch.h"

#include <algorithm>
#include <cstdio>

namespace gridcast::scene {
namespace {

std::string rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

/// 1 where there is nothing to compare with.
double ratio(double now, double at_build) {
  return at_build > 0.0 ? now / at_build : 1.0;
}

}  // namespace

double worsening(const blas::StructureStats& refitted) {
  return std::max(ratio(refitted.cost, refitted.cost_at_build),
                  ratio(refitted.looseness, refitted.looseness_at_build));
}

TreeVerdict judge_refit(const blas::StructureStats& refitted, blas::BuildQuality asked) {
  const double cost = refitted.cost, limit = kMaxRefitCostRatio * refitted.cost_at_build;
  const std::string limits = rounded(kMaxRefitCostRatio) + " times its cost at build, " + rounded(limit);
  const std::string costs = "the refitted tree's cost " + rounded(cost);
  if (!(worsening(refitted) > kMaxRefitCostRatio))
    return {std::nullopt, "Refitted: " + costs + " is within " + limits + "."};
  const bool fast = refitted.triangle_count > kFastRebuildTriangles;
  const std::string order =
      fast ? " In Morton order: more than " + std::to_string(kFastRebuildTriangles) + " triangles."
           : std::string();
  const std::string why = cost > limit ? costs + " exceeds " + limits + "."
                                       : "its boxes fit the triangles " +
                                             rounded(ratio(refitted.looseness, refitted.looseness_at_build)) +
                                             " times more loosely than at build.";
  return {fast ? blas::BuildQuality::kFast : asked, "Rebuilt because " + why + order};
}

}  // namespace gridcast::scene
