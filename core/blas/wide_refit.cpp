// Refits of the whole wide tree.

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/refit_memory.h"
#include "core/blas/wide_cost.h"
#include "core/blas/wide_refit_kernel.h"

namespace gridcast::blas {
namespace {

/// Trees from this size on are written past the caches.
constexpr std::size_t kStreamingBytes = std::size_t(1) << 21;

/// Subtrees in parallel, then the nodes above, last to first.
void refit_parts(const RefitJob& job, const WideParts& parts, RefitStores stores, WideStorage& storage) {
  storage.part_costs.resize(parts.all.size());
  storage.part_boxes.resize(parts.all.size());
  const auto keep = [&](std::uint32_t part, const RefitResult& result) {
    storage.part_boxes[part] = result.box;
    storage.part_costs[part] = result.cost;
  };
  oneapi::tbb::parallel_for(std::size_t(0), parts.subtrees.size(), [&](std::size_t i) {
    const std::uint32_t part = parts.subtrees[i];
    keep(part, refit_subtree(job, parts.all[part], stores));
  });
  for (std::size_t i = parts.above.size(); i-- > 0;) {
    const WideParts::Above& above = parts.above[i];
    std::array<PaddedBox, 8> children;
    for (std::size_t slot = 0; slot < 8; ++slot) children[slot] = storage.part_boxes[above.children[slot]];
    keep(above.part, refit_node(job, parts.all[above.part].begin, children));
  }
}

}  // namespace

std::shared_ptr<WideBvh> WideBvh::unfinished_copy(WideStorage storage) const {
  auto wide = std::make_shared<WideBvh>();
  wide->shape_ = shape_;
  wide->memory_ = memory_;
  wide->storage_ = std::move(storage);
  wide->storage_.version = WideStorage::kUnfinished;
  return wide;
}

Result<std::shared_ptr<const WideBvh>> WideBvh::refit(const mesh::TriangleMesh& moved) const {
  std::shared_ptr<WideBvh> wide = unfinished_copy(memory_->take());
  if (nodes().empty()) return std::shared_ptr<const WideBvh>(std::move(wide));
  const RefitPlan& plan = memory_->plan(*this, moved);
  WideStorage& storage = wide->storage_;
  const bool has_links = storage.nodes.size() == nodes().size();
  storage.nodes.resize(nodes().size());
  storage.blocks.resize(blocks().size());
  const RefitJob job{plan.corners.data(), moved.positions.data(),
                     has_links ? storage.nodes.data() : nodes().data(), storage.nodes.data(),
                     storage.blocks.data()};
  const std::size_t bytes = nodes().size() * sizeof(WideNode) + blocks().size() * sizeof(TriangleBlock);
  const RefitStores stores = bytes >= kStreamingBytes ? RefitStores::kStreaming : RefitStores::kCached;
  refit_parts(job, plan.parts, stores, storage);
  storage.version = memory_->next_version();
  return std::shared_ptr<const WideBvh>(std::move(wide));
}

}  // namespace gridcast::blas
