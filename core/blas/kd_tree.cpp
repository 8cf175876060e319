#include "core/blas/kd_tree.h"

#include <algorithm>
#include <utility>

#include "core/blas/cost_model.h"
#include "core/blas/kd_tree_builder.h"

namespace gridcast::blas {

Result<std::shared_ptr<const KdTree>> KdTree::build(const mesh::TriangleMesh& mesh, std::stop_token stop) {
  Result<KdTreeData> data = build_kd_tree(mesh, std::move(stop));
  if (!data) return data.error();
  auto made = std::make_shared<KdTree>();
  made->data_ = *std::move(data);
  return std::shared_ptr<const KdTree>(std::move(made));
}

void KdTree::add_stats(StructureStats& stats) const {
  struct Visit {
    std::size_t node, depth;
    Bounds3f cell;
  };
  stats.node_count = data_.nodes.size();
  stats.reference_count = data_.references.size();
  stats.memory_bytes = sizeof(KdTree) + data_.nodes.capacity() * sizeof(KdNode) +
                       data_.references.capacity() * sizeof(data_.references[0]);
  stats.leaf_count = stats.max_depth = 0;
  stats.cost = 0.0;
  std::vector<Visit> pending;
  if (!data_.nodes.empty()) pending.push_back({0, 0, data_.bounds});
  while (!pending.empty()) {
    const Visit visit = pending.back();
    pending.pop_back();
    const KdNode& node = data_.nodes[visit.node];
    const double probability = hit_probability(visit.cell, data_.bounds);
    stats.max_depth = std::max(stats.max_depth, visit.depth);
    if (node.is_leaf()) {
      ++stats.leaf_count;
      stats.cost += probability * kTriangleCost * double(node.count());
      continue;
    }
    stats.cost += probability * kKdNodeCost;
    Bounds3f below = visit.cell;
    Bounds3f above = visit.cell;
    below.upper[node.axis()] = above.lower[node.axis()] = node.plane();
    pending.push_back({node.second_child(), visit.depth + 1, above});
    pending.push_back({visit.node + 1, visit.depth + 1, below});
  }
}

Status KdTree::validate(const mesh::TriangleMesh& mesh) const {
  return validate_kd_tree(data_, mesh);
}

}  // namespace gridcast::blas
