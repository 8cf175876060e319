#include "core/blas/kd_tree_builder.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include <oneapi/tbb/parallel_invoke.h>

#include "core/blas/cost_model.h"
#include "core/blas/kd_tree_clip.h"
#include "core/blas/kd_tree_split.h"

namespace gridcast::blas {
namespace {

/// Larger cells are tasks of their own. No effect on the tree.
constexpr std::size_t kTaskSize = 4096;
/// How often a path may take a split that looks worse than a leaf, in the hope of better ones below.
constexpr std::size_t kBadSplits = 3;

/// A cell and what is left of every allowance on its path. Allowances are divided between the children, never
/// taken from a common pot, so that the tree does not depend on which thread comes first.
struct Job {
  std::vector<KdReference> references;
  Bounds3f cell;
  std::size_t levels;      ///< depth left
  std::size_t bad_splits;  ///< left
  std::size_t budget;      ///< references that the leaves below may hold, an empty leaf counting as one
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
    SweepMemory memory;
    std::optional<KdSplit> split;
    std::optional<std::pair<Job, Job>> parts;
    if (job.references.size() > kTaskSize) {
      split = choose(job, memory);
      if (split) parts = divide(job, *split);
    }
    if (!parts) {
      build_inline(std::move(job), *subtree, memory);
      subtree->node_count = subtree->nodes.size();
      subtree->reference_count = subtree->references.size();
      return subtree;
    }
    subtree->root = KdNode::inner(split->axis, split->plane, 0);
    tbb::parallel_invoke([&] { subtree->children[0] = build(std::move(parts->first)); },
                         [&] { subtree->children[1] = build(std::move(parts->second)); });
    const auto& [below, above] = subtree->children;
    subtree->node_count = 1 + below->node_count + above->node_count;
    subtree->reference_count = below->reference_count + above->reference_count;
    return subtree;
  }

 private:
  void build_inline(Job job, Subtree& out, SweepMemory& memory) const {
    const std::size_t self = out.nodes.size();
    std::optional<std::pair<Job, Job>> parts;
    const std::optional<KdSplit> split = choose(job, memory);
    if (split) parts = divide(job, *split);
    if (!parts) {
      out.nodes.push_back(KdNode::leaf(out.references.size(), job.references.size()));
      for (const KdReference& r : job.references) out.references.push_back(r.id);
      return;
    }
    out.nodes.push_back(KdNode::leaf(0, 0));
    build_inline(std::move(parts->first), out, memory);
    out.nodes[self] = KdNode::inner(split->axis, split->plane, out.nodes.size());
    build_inline(std::move(parts->second), out, memory);
  }

  /// None when the cell should be a leaf. A split worse than a leaf is taken a few times on a path, and only
  /// when it separates something: a pile of equal triangles is not copied into both halves.
  [[nodiscard]] static std::optional<KdSplit> choose(Job& job, SweepMemory& memory) {
    const std::size_t n = job.references.size();
    if (n == 0 || job.levels == 0) return std::nullopt;
    const std::optional<KdSplit> split = find_split(job.references, job.cell, memory);
    if (!split || split->cost < kTriangleCost * double(n)) return split;
    if (job.bad_splits == 0 || n <= 2 || 2 * split->count > 3 * n) return std::nullopt;
    --job.bad_splits;
    return split;
  }

  /// None when the children would hold more references than the budget allows; then `job` is untouched.
  [[nodiscard]] std::optional<std::pair<Job, Job>> divide(Job& job, const KdSplit& split) const {
    Bounds3f below = job.cell;
    Bounds3f above = job.cell;
    below.upper[split.axis] = above.lower[split.axis] = split.plane;
    Job first{{}, below, job.levels - 1, job.bad_splits, 0};
    Job second{{}, above, job.levels - 1, job.bad_splits, 0};
    for (const KdReference& r : job.references) {
      const bool goes_below = split.goes_below(r);
      const bool goes_above = split.goes_above(r);
      if (goes_below && goes_above) {
        add_clipped(r, below, first.references);
        add_clipped(r, above, second.references);
      } else if (goes_below) {
        first.references.push_back(r);
      } else if (goes_above) {
        second.references.push_back(r);
      }
    }
    const std::size_t n0 = std::max<std::size_t>(first.references.size(), 1);
    const std::size_t n1 = std::max<std::size_t>(second.references.size(), 1);
    if (n0 + n1 > job.budget) return std::nullopt;
    const std::size_t spare = job.budget - n0 - n1;
    const auto spare_below = std::size_t(double(spare) * (double(n0) / double(n0 + n1)));
    first.budget = n0 + std::min(spare, spare_below);
    second.budget = job.budget - first.budget;
    std::vector<KdReference>().swap(job.references);
    return std::pair{std::move(first), std::move(second)};
  }

  void add_clipped(const KdReference& r, const Bounds3f& cell, std::vector<KdReference>& out) const {
    const std::optional<Bounds3f> box = clip_triangle(mesh_.corners(r.id), cell);
    if (!box) return;
    const Bounds3f tight{glm::max(box->lower, r.lower), glm::min(box->upper, r.upper)};
    if (!tight.empty()) out.push_back({tight.lower, r.id, tight.upper});
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
  Job job{{}, mesh.bounds(), std::min(levels, kMaxKdDepth), kBadSplits, kMaxReferencesPerTriangle * n + 64};
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
