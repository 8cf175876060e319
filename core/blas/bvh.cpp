#include "core/blas/bvh.h"

#include <algorithm>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/bvh_builder.h"
#include "core/blas/cost_model.h"
#include "core/blas/morton_builder.h"

namespace gridcast::blas {
namespace {

/// Node costs are summed in blocks of this many nodes, the blocks in order: the same bits on any number of
/// threads.
constexpr std::size_t kCostBlock = 1 << 14;

bool is_node(std::size_t index) {
  return index != 1;
}

double surface_area_cost(const BvhNodes& nodes) {
  if (nodes.empty()) return 0.0;
  const Bounds3f root = nodes[0].bounds();
  std::vector<double> blocks((nodes.size() + kCostBlock - 1) / kCostBlock, 0.0);
  tbb::parallel_for(std::size_t(0), blocks.size(), [&](std::size_t block) {
    const std::size_t end = std::min(nodes.size(), (block + 1) * kCostBlock);
    for (std::size_t i = block * kCostBlock; i < end; ++i) {
      const double cost = nodes[i].leaf() ? kTriangleCost * double(nodes[i].count) : kNodeCost;
      if (is_node(i)) blocks[block] += cost * hit_probability(nodes[i].bounds(), root);
    }
  });
  double sum = 0.0;
  for (const double block : blocks) sum += block;
  return sum;
}

std::size_t depth_of(const BvhNodes& nodes) {
  if (nodes.empty()) return 0;
  std::vector<std::uint8_t> depth(nodes.size(), 0);
  std::uint8_t deepest = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!is_node(i) || nodes[i].leaf()) continue;
    const auto below = std::uint8_t(depth[i] + 1);
    depth[nodes[i].first] = depth[nodes[i].first + 1] = below;
    deepest = std::max(deepest, below);
  }
  return deepest;
}

}  // namespace

Result<std::shared_ptr<const Bvh>> Bvh::build(const mesh::TriangleMesh& mesh, const BuildOptions& options,
                                              std::stop_token stop) {
  if (mesh.triangle_count() > kMaxBvhPrimitives)
    return Error{ErrorCode::kLimitExceeded, "a BVH holds at most 2^31 triangles", "/triangles"};
  Result<BvhTree> tree = options.quality == BuildQuality::kFast
                             ? build_morton_bvh(mesh, std::move(stop))
                             : build_bvh(mesh, {.split = options.split}, std::move(stop));
  if (!tree) return tree.error();
  auto made = std::make_shared<Bvh>();
  made->nodes_ = std::move(tree->nodes);
  made->primitive_ids_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(tree->primitive_ids));
  return std::shared_ptr<const Bvh>(std::move(made));
}

void Bvh::add_stats(StructureStats& stats) const {
  stats.node_count = nodes_.empty() ? 0 : nodes_.size() - 1;
  stats.leaf_count = (stats.node_count + 1) / 2;
  stats.reference_count = primitive_ids_->size();
  stats.max_depth = depth_of(nodes_);
  stats.memory_bytes =
      sizeof(Bvh) + nodes_.capacity() * sizeof(BvhNode) + primitive_ids_->capacity() * sizeof(std::uint32_t);
  stats.cost = surface_area_cost(nodes_);
}

}  // namespace gridcast::blas
