#include <atomic>
#include <limits>
#include <utility>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include "core/blas/block_bounds.h"
#include "core/blas/refit_memory.h"
#include "core/blas/tree_check.h"
#include "core/blas/wide_cost.h"

namespace gridcast::blas {
namespace {

constexpr std::size_t kBlocksPerTask = 4096;

using BlockIds = std::array<std::uint32_t, 4>;

/// No ray enters the slot.
bool is_closed(const WideNode& node, std::uint32_t slot) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  const Bounds3f box = node.box(slot);
  for (int axis = 0; axis < 3; ++axis)
    if (!(box.lower[axis] >= kLargest && box.upper[axis] <= -kLargest)) return false;
  return true;
}

/// Nodes in the order that refits and repairs rely on, leaves that share out the blocks, no path longer than
/// a traversal's stack.
class Check {
 public:
  Check(const WideNodes& nodes, std::size_t block_count) : nodes_(nodes), block_used_(block_count) {}

  Status run() {
    if (nodes_.empty()) return block_used_.size() == 0 ? ok_status() : wrong_tree("has no root", 0);
    std::vector<Visit> pending{{0, 0}};
    std::uint32_t next = 0;
    while (!pending.empty()) {
      const Visit visit = pending.back();
      pending.pop_back();
      if (visit.node != next || visit.node >= nodes_.size())
        return wrong_tree("has a node out of order", next);
      if (visit.depth > kMaxBvhDepth) return wrong_tree("is too deep", next);
      if (Status status = check_slots(visit.node); !status) return status;
      const WideNode& node = nodes_[visit.node];
      for (std::uint32_t slot = node.slots; slot-- > 0;)
        if (!wide_child::is_leaf(node.child[slot])) pending.push_back({node.child[slot], visit.depth + 1});
      ++next;
    }
    if (next != nodes_.size() || !block_used_.all())
      return wrong_tree("has parts that nothing links to", next);
    return ok_status();
  }

 private:
  struct Visit {
    std::uint32_t node;
    std::size_t depth;
  };

  Status check_slots(std::uint32_t index) {
    const WideNode& node = nodes_[index];
    if (node.slots == 0 || node.slots > 8) return wrong_tree("uses no slot or more than eight", index);
    for (std::uint32_t slot = 0; slot < 8; ++slot) {
      const bool used = slot < node.slots;
      if (used ? !is_proper_box(node.box(slot)) : !is_closed(node, slot))
        return wrong_tree("has a slot with a wrong box", index);
      if (used && wide_child::is_leaf(node.child[slot]) && !take_blocks(node.child[slot]))
        return wrong_tree("has a leaf out of range or twice", index);
    }
    return ok_status();
  }

  bool take_blocks(std::uint32_t link) {
    const std::size_t first = wide_child::index(link), end = first + wide_child::block_count(link);
    if (end > block_used_.size()) return false;
    for (std::size_t block = first; block < end; ++block)
      if (!block_used_.name(block)) return false;
    return true;
  }

  const WideNodes& nodes_;
  Once block_used_;
};

/// Fills in corners; false when a block names what the mesh has not.
bool load_blocks(const std::vector<BlockIds>& ids, const mesh::TriangleMesh& mesh, TriangleBlocks& blocks) {
  blocks.resize(ids.size());
  std::atomic<bool> in_range = true;
  using Range = oneapi::tbb::blocked_range<std::size_t>;
  oneapi::tbb::parallel_for(Range(0, ids.size(), kBlocksPerTask), [&](const Range& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      for (const std::uint32_t id : ids[i])
        if (id >= mesh.triangle_count()) return void(in_range = false);
      std::copy(ids[i].begin(), ids[i].end(), blocks[i].ids);
      load_corners(mesh, blocks[i]);
    }
  });
  return in_range;
}

/// Triangles counted once per leaf that holds them; none when one is in no leaf.
std::optional<std::size_t> count_references(const std::vector<BlockIds>& ids, std::size_t triangle_count) {
  Once named(triangle_count);
  std::size_t references = 0;
  for (const BlockIds& block : ids) {
    for (std::size_t lane = 0; lane < 4; ++lane) {
      if (lane > 0 && block[lane] == block[lane - 1]) continue;
      (void)named.name(block[lane]);
      ++references;
    }
  }
  if (!named.all()) return std::nullopt;
  return references;
}

bool is_proper(const std::vector<PartLooseness>& looseness) {
  const auto is_size = [](double value) { return std::isfinite(value) && value >= 0.0; };
  for (const PartLooseness& part : looseness)
    if (!is_size(part.by_triangles) || !is_size(part.by_box)) return false;
  return true;
}

}  // namespace

void WideBvh::write(TreeWriter& out) const {
  out.reserve(nodes().size() * sizeof(WideNode) + blocks().size() * sizeof(BlockIds) + 64);
  out.value(shape_.spatial);
  out.count(nodes().size());
  for (WideNode node : nodes()) {
    std::ranges::fill(node.unused, 0U);
    out.value(node);
  }
  out.count(blocks().size());
  for (const TriangleBlock& block : blocks()) out.value(block.ids);
  out.column(memory_->planned_looseness());
}

Result<std::shared_ptr<const WideBvh>> WideBvh::read(const mesh::TriangleMesh& mesh, TreeReader& in) {
  auto wide = std::make_shared<WideBvh>();
  const auto spatial = in.value<std::uint8_t>();
  std::vector<BlockIds> ids;
  std::vector<PartLooseness> looseness;
  in.column(wide->storage_.nodes);
  in.column(ids);
  in.column(looseness);
  if (in.failed() || spatial > std::uint8_t(SpatialSplits::kNever)) return wrong_tree("breaks its format", 0);
  if (Status status = Check(wide->nodes(), ids.size()).run(); !status) return status.error();
  if (!load_blocks(ids, mesh, wide->storage_.blocks))
    return wrong_tree("names a triangle that the mesh has not", 0);
  const auto references = count_references(ids, mesh.triangle_count());
  wide->shape_.spatial = SpatialSplits(spatial);
  const bool shares = wide->shape_.spatial != SpatialSplits::kNever;
  if (!references || (!shares && *references != mesh.triangle_count()))
    return wrong_tree("does not list every triangle, or one twice", 0);
  wide->shape_.reference_count = *references;
  wide->measure_shape();
  const WideParts parts(wide->nodes());
  wide->storage_.part_costs = gridcast::blas::part_costs(wide->nodes(), parts);
  if (looseness.empty()) {
    wide->memory_ = std::make_shared<RefitMemory>();
    return std::shared_ptr<const WideBvh>(std::move(wide));
  }
  if (looseness.size() != parts.all.size() || !is_proper(looseness))
    return wrong_tree("knows its parts wrongly", 0);
  RefitPlan plan(*wide, mesh);
  plan.looseness = std::move(looseness);
  wide->memory_ = std::make_shared<RefitMemory>(std::move(plan));
  return std::shared_ptr<const WideBvh>(std::move(wide));
}

}  // namespace gridcast::blas
