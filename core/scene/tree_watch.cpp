#include "core/scene/tree_watch.h"

#include <algorithm>
#include <cstdio>

namespace gridcast::scene {
namespace {

using blas::BuildQuality;
using blas::SpatialSplits;
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
  return kind == StructureKind::kBvh || kind == StructureKind::kWideBvh || kind == StructureKind::kCompactBvh;
}

/// Whether an update, or the background after it, built the tree with shared triangles, and there are any.
bool shares_after_update(const blas::Blas& tree) {
  return tree.options().motion == blas::MeshMotion::kDeforms &&
         tree.options().spatial == SpatialSplits::kAuto &&
         tree.stats().reference_count > tree.stats().triangle_count;
}

/// What there is to say of the form of a tree, as further sentences.
std::string about(const TreeForm& form, double boxes, std::size_t triangles) {
  const std::string met = "a random ray meets the boxes of " + rounded(boxes) + " triangles";
  if (form.spatial == SpatialSplits::kAuto) return " Leaves share triangles: " + met + ".";
  if (form.quality != BuildQuality::kFast || triangles <= kFastRebuildTriangles) return {};
  const auto more_than = [](std::size_t limit) {
    return " In Morton order: more than " + std::to_string(limit) + " triangles";
  };
  if (boxes > kCrowdedBoxes && triangles > kSharedRebuildTriangles)
    return more_than(kSharedRebuildTriangles) +
           ", too many to be shared between leaves in an update, though " + met + ".";
  return more_than(kFastRebuildTriangles) + ".";
}

}  // namespace

TreeForm best_form(double boxes_per_ray, BuildQuality asked) {
  const bool shares = asked == BuildQuality::kDefault && boxes_per_ray > kCrowdedBoxes;
  return {asked, shares ? SpatialSplits::kAuto : SpatialSplits::kNever};
}

TreeForm quick_form(double boxes_per_ray, std::size_t triangles, BuildQuality asked) {
  const TreeForm best = best_form(boxes_per_ray, asked);
  const bool shares = best.spatial == SpatialSplits::kAuto;
  const bool has_time = triangles <= (shares ? kSharedRebuildTriangles : kFastRebuildTriangles);
  return has_time ? best : TreeForm{BuildQuality::kFast, SpatialSplits::kNever};
}

double boxes_per_ray(const blas::StructureStats& stats) {
  const bool is_wide = stats.kind == StructureKind::kWideBvh || stats.kind == StructureKind::kCompactBvh;
  const bool known = is_wide && stats.looseness > 0.0;
  return known ? stats.cost / stats.looseness : 0.0;
}

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
  const std::string why = cost > limit ? costs + " exceeds " + limits + "."
                                       : "its boxes fit the triangles " +
                                             rounded(ratio(refitted.looseness, refitted.looseness_at_build)) +
                                             " times more loosely than at build.";
  const double boxes = boxes_per_ray(refitted);
  const TreeForm form = quick_form(boxes, refitted.triangle_count, terms.asked);
  return {form, "Rebuilt because " + why + about(form, boxes, refitted.triangle_count)};
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
  if (shares_after_update(tree))
    reason += "; with triangles shared between leaves, because their boxes overlap";
  if (wants_better_tree(tree, asked)) reason += "; a better tree is wanted";
  return reason;
}

}  // namespace gridcast::scene
