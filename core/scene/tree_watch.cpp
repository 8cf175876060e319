#include "core/scene/tree_watch.h"

#include <algorithm>
#include <cstdio>

namespace gridcast::scene {
namespace {

using blas::BuildQuality;
using blas::StructureKind;

std::string rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

/// 1 where there is nothing to compare with.
double ratio(double now, double at_build) {
  return at_build > 0.0 ? now / at_build : 1.0;
}

bool is_large(const blas::StructureStats& stats) {
  return stats.triangle_count > kFastRebuildTriangles;
}

/// What a tree is worse by than the good one that was asked for, when it is built.
double worse_at_build(BuildQuality built, BuildQuality asked) {
  return built == BuildQuality::kFast && asked == BuildQuality::kDefault ? kMortonCostRatio : 1.0;
}

/// The structures that are built in Morton order when that is asked for.
bool has_morton_order(StructureKind kind) {
  return kind == StructureKind::kBvh || kind == StructureKind::kWideBvh;
}

}  // namespace

double worsening(const blas::StructureStats& refitted) {
  return std::max(ratio(refitted.cost, refitted.cost_at_build),
                  ratio(refitted.looseness, refitted.looseness_at_build));
}

TreeVerdict judge_refit(const blas::StructureStats& refitted, const TreeTerms& terms) {
  const double allowed = kMaxRefitCostRatio / worse_at_build(terms.built, terms.asked);
  const double cost = refitted.cost, limit = allowed * refitted.cost_at_build;
  const std::string limits = rounded(allowed) + " times its cost at build, " + rounded(limit);
  const std::string costs = "the refitted tree's cost " + rounded(cost);
  if (!(worsening(refitted) > allowed))
    return {std::nullopt, "Refitted: " + costs + " is within " + limits + "."};
  const bool fast = is_large(refitted);
  const std::string order =
      fast ? " In Morton order: more than " + std::to_string(kFastRebuildTriangles) + " triangles."
           : std::string();
  const std::string why = cost > limit ? costs + " exceeds " + limits + "."
                                       : "its boxes fit the triangles " +
                                             rounded(ratio(refitted.looseness, refitted.looseness_at_build)) +
                                             " times more loosely than at build.";
  return {fast ? BuildQuality::kFast : terms.asked, "Rebuilt because " + why + order};
}

bool wants_better_tree(const blas::Blas& tree, BuildQuality asked) {
  const blas::StructureStats& stats = tree.stats();
  if (!is_large(stats) || !tree.can_refit()) return false;
  const double at_build = has_morton_order(stats.kind) ? worse_at_build(tree.options().quality, asked) : 1.0;
  return at_build > 1.0 || worsening(stats) > kOrderCostRatio;
}

std::string reason_of(const blas::Blas& tree, BuildQuality asked) {
  std::string reason = tree.stats().reason;
  if (has_morton_order(tree.stats().kind) && tree.options().quality == BuildQuality::kFast)
    reason += "; in Morton order, because its vertices moved";
  if (wants_better_tree(tree, asked)) reason += "; a better tree is wanted";
  return reason;
}

}  // namespace gridcast::scene
