#include "core/blas/kd_tree_builder.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <tuple>

#include <oneapi/tbb/parallel_invoke.h>

#include "core/blas/kd_tree_clip.h"
#include "core/blas/kd_tree_split.h"

namespace gridcast::blas {
namespace {

/// Larger cells are tasks of their own. No effect on the tree.
constexpr std::size_t kTaskSize = 4096;

/// A cell and what is left of every allowance on its path. Allowances are divided between the children, never
/// taken from a common pot, so that the tree does not depend on which thread comes first.
struct Cell {
  Bounds3f box;
  std::size_t levels = 0;  ///< depth left
  std::size_t budget = 0;  ///< references that the leaves below may hold, an empty leaf counting as one
};

struct Job {
  std::vector<KdReference> references;
  Cell cell;
};

/// The references of the cells on the way down from a task's root: those of the cell in hand lie on top.
/// Storage is kept, so a cell costs no allocation.
class ReferenceStack {
 public:
  explicit ReferenceStack(std::vector<KdReference> references)
      : storage_(std::move(references)), size_(storage_.size()) {}
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::span<KdReference> from(std::size_t begin) {
    return std::span(storage_).subspan(begin, size_ - begin);
  }
  void shrink(std::size_t size) { size_ = size; }
  /// Room for `count` more references on top, to be written in place and then taken by grow().
  KdReference* room(std::size_t count) {
    if (storage_.size() < size_ + count) storage_.resize(std::max(2 * storage_.size(), size_ + count));
    return storage_.data() + size_;
  }
  void grow(std::size_t count) { size_ += count; }

 private:
  std::vector<KdReference> storage_;
  std::size_t size_;
};

/// A cell's subtree: two children, or nodes in depth-first order with links relative to their start.
struct Subtree {
  KdNode root = KdNode::leaf(0, 0);
  std::unique_ptr<Subtree> children[2];
  std::vector<KdNode> nodes;
  std::vector<std::uint32_t> references;
  std::size_t node_count = 0;
  std::size_t reference_count = 0;
};

class Builder {
 public:
  Builder(const mesh::TriangleMesh& mesh, std::stop_token stop) : mesh_(mesh), stop_(std::move(stop)) {}

  [[nodiscard]] std::unique_ptr<Subtree> build(Job job) const {
    auto subtree = std::make_unique<Subtree>();
    if (stop_.stop_requested()) return subtree;
    std::optional<KdSplit> split;
    if (job.references.size() > kTaskSize) split = choose(job.references, job.cell);
    if (!split) {
      ReferenceStack stack(std::move(job.references));
      build_inline(stack, 0, job.cell, *subtree);
      subtree->node_count = subtree->nodes.size();
      subtree->reference_count = subtree->references.size();
      return subtree;
    }
    Job first, second;
    divide(job, *split, first, second);
    subtree->root = KdNode::inner(split->axis, split->plane, 0);
    tbb::parallel_invoke([&] { subtree->children[0] = build(std::move(first)); },
                         [&] { subtree->children[1] = build(std::move(second)); });
    const auto& [below, above] = subtree->children;
    subtree->node_count = 1 + below->node_count + above->node_count;
    subtree->reference_count = below->reference_count + above->reference_count;
    return subtree;
  }

 private:
  /// Builds over the references from `begin` to the top of `stack`, and takes them off.
  void build_inline(ReferenceStack& stack, std::size_t begin, const Cell& cell, Subtree& out) const {
    const std::size_t self = out.nodes.size();
    const std::optional<KdSplit> split = choose(stack.from(begin), cell);
    if (!split) {
      out.nodes.push_back(KdNode::leaf(out.references.size(), stack.size() - begin));
      for (const KdReference& r : stack.from(begin)) out.references.push_back(r.id);
      stack.shrink(begin);
      return;
    }
    // What goes above stays in place, closing ranks; what goes below is written on top and built first.
    const std::size_t end = stack.size();
    KdReference* const below = stack.room(end - begin);
    KdReference* const above = stack.from(begin).data();
    auto [lower, upper] = halves(cell, *split);
    std::size_t below_count = 0, above_count = 0;
    for (const KdReference& r : stack.from(begin)) {
      const KdReference whole = r;
      part(
          whole, *split, lower.box, upper.box, [&](const KdReference& p) { below[below_count++] = p; },
          [&](const KdReference& p) { above[above_count++] = p; });
    }
    share_budget(cell, below_count, above_count, lower, upper);
    stack.grow(below_count);
    out.nodes.push_back(KdNode::leaf(0, 0));
    build_inline(stack, end, lower, out);
    out.nodes[self] = KdNode::inner(split->axis, split->plane, out.nodes.size());
    stack.shrink(begin + above_count);
    build_inline(stack, begin, upper, out);
  }

  /// None when the cell should be a leaf: no plane saves anything, or an allowance is used up.
  [[nodiscard]] static std::optional<KdSplit> choose(std::span<const KdReference> references,
                                                     const Cell& cell) {
    const std::size_t n = references.size();
    if (n < kSmallestSplit || cell.levels == 0) return std::nullopt;
    const std::optional<KdSplit> split = find_split(references, cell.box);
    if (!split || split->cost >= leaf_cost(n)) return std::nullopt;
    std::size_t below = 0, above = 0;
    for (const KdReference& r : references) {
      below += std::size_t(split->goes_below(r));
      above += std::size_t(split->goes_above(r));
    }
    if (std::max<std::size_t>(below, 1) + std::max<std::size_t>(above, 1) > cell.budget) return std::nullopt;
    return split;
  }

  /// Parts `job`, freeing its references.
  void divide(Job& job, const KdSplit& split, Job& first, Job& second) const {
    std::tie(first.cell, second.cell) = halves(job.cell, split);
    first.references.reserve(job.references.size() / 2);
    second.references.reserve(job.references.size() / 2);
    for (const KdReference& r : job.references)
      part(
          r, split, first.cell.box, second.cell.box,
          [&](const KdReference& p) { first.references.push_back(p); },
          [&](const KdReference& p) { second.references.push_back(p); });
    share_budget(job.cell, first.references.size(), second.references.size(), first.cell, second.cell);
    std::vector<KdReference>().swap(job.references);
  }

  static std::pair<Cell, Cell> halves(const Cell& cell, const KdSplit& split) {
    std::pair<Cell, Cell> made{cell, cell};
    made.first.box.upper[split.axis] = made.second.box.lower[split.axis] = split.plane;
    --made.first.levels;
    --made.second.levels;
    return made;
  }

  static void share_budget(const Cell& cell, std::size_t below_count, std::size_t above_count, Cell& lower,
                           Cell& upper) {
    const std::size_t n0 = std::max<std::size_t>(below_count, 1);
    const std::size_t n1 = std::max<std::size_t>(above_count, 1);
    const std::size_t spare = cell.budget - n0 - n1;
    const auto spare_below = std::size_t(double(spare) * (double(n0) / double(n0 + n1)));
    lower.budget = n0 + std::min(spare, spare_below);
    upper.budget = cell.budget - lower.budget;
  }

  /// Hands `r`, or the parts of it on either side of the plane, to the sides it goes to.
  template <class Below, class Above>
  void part(const KdReference& r, const KdSplit& split, const Bounds3f& lower, const Bounds3f& upper,
            Below&& to_below, Above&& to_above) const {
    const bool goes_below = split.goes_below(r);
    const bool goes_above = split.goes_above(r);
    if (goes_below && goes_above) {
      if (const std::optional<KdReference> clipped = clip(r, lower)) to_below(*clipped);
      if (const std::optional<KdReference> clipped = clip(r, upper)) to_above(*clipped);
    } else if (goes_below) {
      to_below(r);
    } else if (goes_above) {
      to_above(r);
    }
  }

  [[nodiscard]] std::optional<KdReference> clip(const KdReference& r, const Bounds3f& cell) const {
    const std::optional<Bounds3f> box = clip_triangle(mesh_.corners(r.id), cell);
    if (!box) return std::nullopt;
    const Bounds3f tight{glm::max(box->lower, r.lower), glm::min(box->upper, r.upper)};
    if (tight.empty()) return std::nullopt;
    return KdReference{tight.lower, r.id, tight.upper};
  }

  const mesh::TriangleMesh& mesh_;
  std::stop_token stop_;
};

/// Writes a subtree from node and reference number `node` and `reference` on, freeing it on the way.
void flatten(std::unique_ptr<Subtree> subtree, KdTreeData& tree, std::size_t node, std::size_t reference) {
  if (subtree->children[0] == nullptr) {
    for (std::size_t i = 0; i < subtree->nodes.size(); ++i) {
      const KdNode& relative = subtree->nodes[i];
      tree.nodes[node + i] = relative.is_leaf() ? KdNode::leaf(reference + relative.first(), relative.count())
                                                : KdNode::inner(relative.axis(), relative.plane(),
                                                                node + relative.second_child());
    }
    std::copy(subtree->references.begin(), subtree->references.end(),
              tree.references.begin() + std::ptrdiff_t(reference));
    return;
  }
  const std::size_t second = node + 1 + subtree->children[0]->node_count;
  const std::size_t second_reference = reference + subtree->children[0]->reference_count;
  tree.nodes[node] = KdNode::inner(subtree->root.axis(), subtree->root.plane(), second);
  tbb::parallel_invoke([&] { flatten(std::move(subtree->children[0]), tree, node + 1, reference); },
                       [&] { flatten(std::move(subtree->children[1]), tree, second, second_reference); });
}

Job root_job(const mesh::TriangleMesh& mesh) {
  const std::size_t n = mesh.triangle_count();
  const auto levels = std::size_t(8.0 + 1.3 * std::log2(double(n)));
  Job job{{}, {mesh.bounds(), std::min(levels, kMaxKdDepth), kMaxReferencesPerTriangle * n + 64}};
  job.references.reserve(n);
  for (std::uint32_t id = 0; id < n; ++id) {
    const Bounds3f box = mesh.triangle_bounds(id);
    job.references.push_back({box.lower, id, box.upper});
  }
  return job;
}

}  // namespace

Result<KdTreeData> build_kd_tree(const mesh::TriangleMesh& mesh, std::stop_token stop) {
  if (mesh.triangle_count() > kMaxKdTriangles)
    return Error{ErrorCode::kLimitExceeded, "a kd-tree holds at most 2^26 triangles", "/triangles"};
  KdTreeData tree;
  tree.bounds = mesh.bounds();
  if (mesh.triangle_count() == 0) return tree;
  std::unique_ptr<Subtree> root = Builder(mesh, stop).build(root_job(mesh));
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the build was cancelled", {}};
  tree.nodes.resize(root->node_count, KdNode::leaf(0, 0));
  tree.references.resize(root->reference_count);
  flatten(std::move(root), tree, 0, 0);
  return tree;
}

}  // namespace gridcast::blas
