#include "core/blas/wide_bvh.h"

#include <algorithm>
#include <utility>

#include "core/blas/bvh_builder.h"
#include "core/blas/refit_memory.h"
#include "core/blas/wide_cost.h"
#include "core/blas/wide_layout.h"
#include "core/blas/wide_morton_builder.h"

namespace gridcast::blas {

Result<std::shared_ptr<const WideBvh>> WideBvh::build(const mesh::TriangleMesh& mesh,
                                                      const BuildOptions& options, std::stop_token stop) {
  if (mesh.triangle_count() >= wide_child::kIndexMask)
    return Error{ErrorCode::kLimitExceeded, "more than 2^30 triangles in one mesh", "/triangles"};
  auto wide = std::make_shared<WideBvh>();
  wide->memory_ = std::make_shared<RefitMemory>();
  if (mesh.triangles.empty()) return std::shared_ptr<const WideBvh>(wide);
  const bool fast = options.quality == BuildQuality::kFast;
  wide->shape_.spatial = fast ? SpatialSplits::kNever : options.spatial;
  wide->shape_.reference_count = mesh.triangle_count();
  if (fast) {
    Status status = build_wide_in_morton_order(mesh, stop, wide->storage_.nodes, wide->storage_.blocks);
    if (!status) return status.error();
  } else {
    const BvhBuildConfig config{.block = LeafBlock::kFour, .spatial = options.spatial};
    const Result<BvhTree> tree = build_bvh(mesh, config, std::move(stop));
    if (!tree) return tree.error();
    wide->shape_.reference_count = tree->primitive_ids.size();
    lay_out(*tree, mesh, wide->storage_.nodes, wide->storage_.blocks);
  }
  wide->measure_shape();
  wide->storage_.part_costs = gridcast::blas::part_costs(wide->nodes(), WideParts(wide->nodes()));
  return std::shared_ptr<const WideBvh>(wide);
}

WideBvh::~WideBvh() {
  if (memory_) memory_->give_back(std::move(storage_));
}

void WideBvh::measure_shape() {
  const WideNodes& nodes = storage_.nodes;
  std::vector<std::uint8_t> depth(nodes.size(), 0);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    shape_.max_depth = std::max(shape_.max_depth, std::size_t(depth[i]));
    for (std::uint32_t slot = 0; slot < nodes[i].slots; ++slot) {
      const std::uint32_t link = nodes[i].child[slot];
      if (wide_child::is_leaf(link))
        ++shape_.leaf_count;
      else
        depth[link] = std::uint8_t(depth[i] + 1);
    }
  }
}

void WideBvh::add_stats(StructureStats& stats) const {
  stats.node_count = nodes().size();
  stats.leaf_count = shape_.leaf_count;
  stats.reference_count = shape_.reference_count;
  stats.max_depth = shape_.max_depth;
  stats.memory_bytes = nodes().capacity() * sizeof(WideNode) + blocks().capacity() * sizeof(TriangleBlock) +
                       (memory_ ? memory_->memory_bytes() : 0);
  stats.cost = tree_cost(nodes(), storage_.part_costs);
}

}  // namespace gridcast::blas
