#include "core/blas/bvh_builder.h"

#include <memory>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_invoke.h>

#include "core/blas/cost_model.h"

namespace gridcast::blas {
namespace {

/// References [first, first + count), to become a node at `depth`.
struct Range {
  std::size_t first = 0;
  std::size_t count = 0;
  std::size_t depth = 0;
  SetBounds bounds;
};

/// A node with all that is below it. Above the task size it has two children; below, everything sits in
/// `nodes` in the final order, with links relative to its start.
struct Subtree {
  BvhNode root{};
  std::vector<BvhNode> nodes;
  std::unique_ptr<Subtree> children[2];
  std::size_t node_count = 0;  ///< without the root
};

class Builder {
 public:
  Builder(std::vector<BuildReference>& references, const BvhBuildConfig& config, std::stop_token stop)
      : references_(references), config_(config), stop_(std::move(stop)) {}

  [[nodiscard]] std::unique_ptr<Subtree> build(const Range& range) const {
    auto subtree = std::make_unique<Subtree>();
    if (stop_.stop_requested()) return subtree;
    if (range.count <= config_.task_size) {
      build_inline(range, subtree->root, subtree->nodes);
      subtree->nodes.shrink_to_fit();
      subtree->node_count = subtree->nodes.size();
      return subtree;
    }
    const std::optional<Division> division = divide(range);  // never none: larger than a leaf
    const Range first = part(range, *division, 0);
    const Range second = part(range, *division, 1);
    tbb::parallel_invoke([&] { subtree->children[0] = build(first); },
                         [&] { subtree->children[1] = build(second); });
    set_inner(subtree->root, range, 0);
    subtree->node_count = 2 + subtree->children[0]->node_count + subtree->children[1]->node_count;
    return subtree;
  }

 private:
  /// Recursion is at most kMaxBvhDepth deep. `nodes` may move, so `self` of a child is written last.
  void build_inline(const Range& range, BvhNode& self, std::vector<BvhNode>& nodes) const {
    const std::optional<Division> division = divide(range);
    if (!division) {
      self = {range.bounds.boxes.lower, std::uint32_t(range.first), range.bounds.boxes.upper,
              std::uint32_t(range.count)};
      return;
    }
    const std::size_t pair = nodes.size();
    set_inner(self, range, pair);
    nodes.resize(pair + 2);
    for (std::size_t side = 0; side < 2; ++side) {
      BvhNode child{};
      build_inline(part(range, *division, side), child, nodes);
      nodes[pair + side] = child;
    }
  }

  /// None when the range should be a leaf.
  [[nodiscard]] std::optional<Division> divide(const Range& range) const {
    const bool may_be_leaf = range.count <= config_.max_leaf_size;
    const std::span<BuildReference> span(references_.data() + range.first, range.count);
    if (range.count == 1) return std::nullopt;
    // Only halving is certain to end within the depth that a traversal has a stack for.
    if (range.depth >= kMaxFreeDepth || config_.split == BvhSplit::kMedian)
      return may_be_leaf ? std::nullopt : std::optional(divide_at_median(span, range.bounds));
    std::optional<Division> division;
    if (config_.split == BvhSplit::kMidpoint) {
      if (may_be_leaf) return std::nullopt;
      division = divide_at_midpoint(span, range.bounds);
    } else {
      // One node costs more than such a leaf, wherever it is split.
      if (may_be_leaf && kTriangleCost * double(range.count) <= kNodeCost) return std::nullopt;
      const std::optional<BinnedSplit> split = find_binned_split(span, range.bounds);
      if (may_be_leaf && (!split || split->cost >= kTriangleCost * double(range.count))) return std::nullopt;
      if (split) division = divide_at_bin(span, range.bounds, *split);
    }
    return division ? division : divide_at_median(span, range.bounds);
  }

  static Range part(const Range& range, const Division& division, std::size_t side) {
    const std::size_t first = side == 0 ? range.first : range.first + division.middle;
    const std::size_t count = side == 0 ? division.middle : range.count - division.middle;
    return {first, count, range.depth + 1, division.parts[side]};
  }
  static void set_inner(BvhNode& node, const Range& range, std::size_t first_child) {
    node = {range.bounds.boxes.lower, std::uint32_t(first_child), range.bounds.boxes.upper, 0};
  }

  std::vector<BuildReference>& references_;
  const BvhBuildConfig& config_;
  std::stop_token stop_;
};

/// Writes a subtree's root to `self` and the nodes below it from `base` on, freeing it on the way.
void flatten(std::unique_ptr<Subtree> subtree, BvhNodes& nodes, std::size_t self, std::size_t base) {
  nodes[self] = subtree->root;
  if (subtree->root.leaf()) return;
  nodes[self].first = std::uint32_t(base + subtree->root.first);
  if (subtree->children[0] == nullptr) {
    for (std::size_t i = 0; i < subtree->nodes.size(); ++i) {
      nodes[base + i] = subtree->nodes[i];
      if (!nodes[base + i].leaf()) nodes[base + i].first += std::uint32_t(base);
    }
    return;
  }
  const std::size_t second = base + 2 + subtree->children[0]->node_count;
  tbb::parallel_invoke([&] { flatten(std::move(subtree->children[0]), nodes, base, base + 2); },
                       [&] { flatten(std::move(subtree->children[1]), nodes, base + 1, second); });
}

Error cancelled() {
  return {ErrorCode::kCancelled, "the build was cancelled", {}};
}

}  // namespace

Result<BvhTree> build_bvh(std::vector<BuildReference> references, const BvhBuildConfig& config,
                          std::stop_token stop) {
  if (references.size() > kMaxBvhPrimitives)
    return Error{ErrorCode::kLimitExceeded, "a BVH holds at most 2^31 triangles", "/triangles"};
  BvhTree tree;
  if (references.empty()) return tree;

  std::unique_ptr<Subtree> root =
      Builder(references, config, stop).build({0, references.size(), 0, bounds_of(references)});
  if (stop.stop_requested()) return cancelled();
  tree.primitive_ids.resize(references.size());
  tbb::parallel_for(std::size_t(0), references.size(),
                    [&](std::size_t i) { tree.primitive_ids[i] = references[i].id; });
  std::vector<BuildReference>().swap(references);

  tree.nodes.resize(2 + root->node_count);
  flatten(std::move(root), tree.nodes, 0, 2);
  return tree;
}

}  // namespace gridcast::blas
