#include "core/blas/kd_tree.h"

#include <algorithm>
#include <utility>

#include "core/blas/cost_model.h"
#include "core/blas/kd_layout.h"
#include "core/blas/kd_tree_builder.h"

namespace gridcast::blas {

Result<std::shared_ptr<const KdTree>> KdTree::build(const mesh::TriangleMesh& mesh, std::stop_token stop) {
  Result<KdTreeData> data = build_kd_tree(mesh, std::move(stop));
  if (!data) return data.error();
  auto made = std::make_shared<KdTree>();
  made->layout_ = lay_out(*data, mesh);
  return std::shared_ptr<const KdTree>(std::move(made));
}

void KdTree::add_stats(StructureStats& stats) const {
  struct Visit {
    std::size_t treelet, depth;
    Bounds3f cell;
  };
  const auto bytes = [](const auto& column) { return column.capacity() * sizeof(column[0]); };
  stats.node_count = layout_.treelets.size();
  stats.memory_bytes =
      sizeof(KdTree) + bytes(layout_.treelets) + bytes(layout_.blocks) + bytes(layout_.triangles);
  stats.leaf_count = stats.reference_count = stats.max_depth = 0;
  stats.cost = 0.0;
  std::vector<Visit> pending;
  if (!layout_.treelets.empty()) pending.push_back({0, 0, layout_.bounds});
  while (!pending.empty()) {
    const Visit visit = pending.back();
    pending.pop_back();
    const KdTreelet& treelet = layout_.treelets[visit.treelet];
    stats.max_depth = std::max(stats.max_depth, visit.depth);
    stats.cost += kTreeletCost * hit_probability(visit.cell, layout_.bounds);
    for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
      if (!treelet.is_used(slot)) continue;
      const Bounds3f cell = treelet.child_cell(slot, visit.cell);
      if (treelet.is_inner(slot)) {
        pending.push_back({treelet.child(slot), visit.depth + 1, cell});
        continue;
      }
      ++stats.leaf_count;
      const std::uint32_t blocks = treelet.block_count(slot);
      for (std::uint32_t i = 0; i < blocks; ++i)
        stats.reference_count += layout_.blocks[treelet.block(slot) + i].size();
      stats.cost += kIndexedBlockCost * blocks * hit_probability(cell, layout_.bounds);
    }
  }
}

Status KdTree::validate(const mesh::TriangleMesh& mesh) const {
  return validate_kd_tree(layout_, mesh);
}

}  // namespace gridcast::blas
