#include "core/blas/compact_bvh.h"

#include <algorithm>
#include <array>
#include <utility>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/compact_layout.h"
#include "core/blas/cost_model.h"

namespace gridcast::blas {
namespace {

/// Node costs are summed in blocks of this many nodes, the blocks in order: the same bits on any number of
/// threads.
constexpr std::size_t kCostBlock = std::size_t(1) << 12;
/// Inner children of the topmost levels are refitted as tasks of their own: some thousands in a large tree.
constexpr int kTaskLevels = 4;

double cost_of(const CompactNode& node, const Bounds3f& root) {
  double cost = 0.0;
  for (std::uint32_t slot = 0; slot < node.slot_count(); ++slot) {
    const std::uint32_t link = compact_child::of(node, slot);
    const bool leaf = (link & compact_child::kLeafBit) != 0;
    const double blocks = leaf && compact_child::count(link) > 4 ? 2.0 : 1.0;
    cost += (leaf ? kBlockCost * blocks : kWideNodeCost) * hit_probability(node.box(slot), root);
  }
  return cost;
}

double surface_area_cost(const CompactNodes& nodes) {
  Bounds3f root;
  for (std::uint32_t slot = 0; slot < nodes[0].slot_count(); ++slot) root.extend(nodes[0].box(slot));
  std::vector<double> blocks((nodes.size() + kCostBlock - 1) / kCostBlock, 0.0);
  oneapi::tbb::parallel_for(std::size_t(0), blocks.size(), [&](std::size_t block) {
    const std::size_t end = std::min(nodes.size(), (block + 1) * kCostBlock);
    for (std::size_t i = block * kCostBlock; i < end; ++i) blocks[block] += cost_of(nodes[i], root);
  });
  double sum = kWideNodeCost;
  for (const double block : blocks) sum += block;
  return sum;
}

/// Draws the boxes of a tree around its triangles, children before parents.
class Refit {
 public:
  Refit(CompactNodes& nodes, const std::vector<std::uint32_t>& ids, const mesh::TriangleMesh& mesh)
      : nodes_(nodes), ids_(ids), mesh_(mesh) {}

  /// Returns the float box of all below the node.
  Bounds3f draw(std::uint32_t index, int level) const {
    CompactNode& node = nodes_[index];
    std::array<Bounds3f, 8> boxes;
    const auto draw_child = [&](std::uint32_t slot) {
      boxes[slot] = draw(node.first_child + slot, level + 1);
    };
    if (level < kTaskLevels)
      oneapi::tbb::parallel_for(std::uint32_t(0), node.inner_count(), draw_child);
    else
      for (std::uint32_t slot = 0; slot < node.inner_count(); ++slot) draw_child(slot);
    for (std::uint32_t slot = node.inner_count(); slot < node.slot_count(); ++slot)
      boxes[slot] = leaf_box(compact_child::of(node, slot));
    node.set_boxes(std::span(boxes).first(node.slot_count()));
    Bounds3f all;
    for (const Bounds3f& box : boxes) all.extend(box);
    return all;
  }

 private:
  [[nodiscard]] Bounds3f leaf_box(std::uint32_t link) const {
    Bounds3f box;
    const std::uint32_t first = compact_child::first_id(link);
    for (std::uint32_t i = first; i < first + compact_child::count(link); ++i)
      box.extend(primitive_bounds(mesh_, ids_[i]));
    return box;
  }

  CompactNodes& nodes_;
  const std::vector<std::uint32_t>& ids_;
  const mesh::TriangleMesh& mesh_;
};

}  // namespace

Result<std::shared_ptr<const CompactBvh>> CompactBvh::build(const mesh::TriangleMesh& mesh,
                                                            const BuildOptions& options,
                                                            std::stop_token stop) {
  auto wide = WideBvh::build(mesh, options, std::move(stop));
  if (!wide) return wide.error();
  auto layout = compacted(**wide);
  if (!layout) return layout.error();
  auto made = std::make_shared<CompactBvh>();
  made->nodes_ = std::move(layout->nodes);
  made->ids_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(layout->ids));
  made->spatial_ = options.quality == BuildQuality::kFast ? SpatialSplits::kNever : options.spatial;
  return std::shared_ptr<const CompactBvh>(std::move(made));
}

Result<std::shared_ptr<const CompactBvh>> CompactBvh::refit(const mesh::TriangleMesh& moved) const {
  auto made = std::make_shared<CompactBvh>();
  made->nodes_ = nodes_;
  made->ids_ = ids_;
  made->spatial_ = spatial_;
  if (!nodes_.empty()) Refit(made->nodes_, *ids_, moved).draw(0, 0);
  return std::shared_ptr<const CompactBvh>(std::move(made));
}

void CompactBvh::add_stats(StructureStats& stats) const {
  stats.node_count = nodes_.size();
  stats.reference_count = ids_->size();
  stats.leaf_count = stats.max_depth = 0;
  stats.memory_bytes =
      sizeof(CompactBvh) + nodes_.capacity() * sizeof(CompactNode) + ids_->capacity() * sizeof(std::uint32_t);
  std::vector<std::uint8_t> depth(nodes_.size(), 0);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const CompactNode& node = nodes_[i];
    stats.max_depth = std::max(stats.max_depth, std::size_t(depth[i]));
    stats.leaf_count += node.slot_count() - node.inner_count();
    for (std::uint32_t slot = 0; slot < node.inner_count(); ++slot)
      depth[node.first_child + slot] = std::uint8_t(depth[i] + 1);
  }
  stats.cost = nodes_.empty() ? 0.0 : surface_area_cost(nodes_);
}

}  // namespace gridcast::blas
