// Refits of a few vertices: their leaves, and what is above those.

#include <algorithm>
#include <queue>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include "core/blas/block_bounds.h"
#include "core/blas/refit_memory.h"
#include "core/blas/wide_cost.h"

namespace gridcast::blas {
namespace {

/// A patch of more than this share of the blocks costs more than a refit of all.
constexpr std::size_t kPatchShare = 24;
/// How many versions back memory may come from and still be brought up to date block by block.
constexpr std::size_t kMaxHistory = 4;

void sort_unique(std::vector<std::uint32_t>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

template <class Vector>
void copy_all(const Vector& from, Vector& to) {
  to.resize(from.size());
  using Range = oneapi::tbb::blocked_range<std::size_t>;
  oneapi::tbb::parallel_for(Range(0, from.size(), 4096), [&](const Range& range) {
    std::copy(from.begin() + std::ptrdiff_t(range.begin()), from.begin() + std::ptrdiff_t(range.end()),
              to.begin() + std::ptrdiff_t(range.begin()));
  });
}

/// Draws blocks anew in a tree that is valid but for them, and the boxes above as far as they change.
class Patch {
 public:
  Patch(const RefitPlan& plan, const VertexLinks& links, const mesh::TriangleMesh& mesh, WideStorage& storage)
      : plan_(plan), links_(links), mesh_(mesh), storage_(storage) {}

  void run(const std::vector<std::uint32_t>& blocks) {
    for (const std::uint32_t block : blocks) {
      load_corners(mesh_, storage_.blocks[block]);
      draw_leaf(block);
    }
    // Children come after their parents: the largest number first is bottom up.
    std::vector<std::uint32_t> parts;
    while (!changed_.empty()) {
      const std::uint32_t node = changed_.top();
      while (!changed_.empty() && changed_.top() == node) changed_.pop();
      const auto part = std::uint32_t(plan_.parts.part_of(node));
      if (parts.empty() || parts.back() != part) parts.push_back(part);
      if (node != 0) draw_in_parent(node);
    }
    sort_unique(parts);
    for (const std::uint32_t part : parts)
      storage_.part_costs[part] = part_cost(storage_.nodes, plan_.parts.all[part]);
  }

 private:
  void draw_leaf(std::uint32_t block) {
    const std::uint32_t node = links_.node_of_block[block];
    const WideNode& n = storage_.nodes[node];
    for (std::uint32_t slot = 0; slot < n.slots; ++slot) {
      const std::uint32_t link = n.child[slot];
      const std::uint32_t first = wide_child::index(link);
      if (!wide_child::is_leaf(link) || block < first || block >= first + wide_child::block_count(link))
        continue;
      LaneBounds bounds;
      for (std::uint32_t b = 0; b < wide_child::block_count(link); ++b)
        bounds.extend(storage_.blocks[first + b]);
      return set_box(node, slot, bounds.bounds());
    }
  }

  void draw_in_parent(std::uint32_t node) {
    const std::uint32_t parent = links_.parent[node];
    const WideNode& p = storage_.nodes[parent];
    Bounds3f box;
    for (std::uint32_t slot = 0; slot < storage_.nodes[node].slots; ++slot)
      box.extend(storage_.nodes[node].box(slot));
    for (std::uint32_t slot = 0; slot < p.slots; ++slot)
      if (p.child[slot] == node) return set_box(parent, slot, box);
  }

  void set_box(std::uint32_t node, std::uint32_t slot, const Bounds3f& box) {
    if (storage_.nodes[node].box(slot) == box) return;
    storage_.nodes[node].set_box(slot, box);
    changed_.push(node);
  }

  const RefitPlan& plan_;
  const VertexLinks& links_;
  const mesh::TriangleMesh& mesh_;
  WideStorage& storage_;
  std::priority_queue<std::uint32_t> changed_;  ///< nodes with a box drawn anew, maybe several times
};

}  // namespace

bool WideBvh::add_missed(const WideStorage& storage, std::vector<std::uint32_t>& blocks) const {
  if (storage.nodes.size() != nodes().size()) return false;
  std::vector<std::uint32_t> missed;
  for (const PatchedFrom& step : history_) {
    missed.insert(missed.end(), step.blocks->begin(), step.blocks->end());
    if (step.version != storage.version) continue;
    blocks.insert(blocks.end(), missed.begin(), missed.end());
    sort_unique(blocks);
    return true;
  }
  return false;
}

Result<std::shared_ptr<const WideBvh>> WideBvh::refit(const mesh::TriangleMesh& moved,
                                                      std::span<const std::uint32_t> vertices) const {
  // Leaves of a build with spatial splits have boxes of parts of triangles, which a refit does not keep.
  const bool has_parts = shape_.spatial != SpatialSplits::kNever && storage_.version == 0;
  const bool has_many = vertices.size() > moved.positions.size() / kPatchShare;
  if (nodes().empty() || has_parts || has_many) return refit(moved);
  const VertexLinks& links = memory_->links(*this, moved);
  std::vector<std::uint32_t> changed;
  for (const std::uint32_t vertex : vertices) {
    const auto blocks = links.blocks_of(vertex);
    changed.insert(changed.end(), blocks.begin(), blocks.end());
  }
  sort_unique(changed);
  if (changed.size() > blocks().size() / kPatchShare) return refit(moved);

  WideStorage recycled = memory_->take();
  std::vector<std::uint32_t> stale = changed;
  const bool current_but_for_stale = add_missed(recycled, stale);
  std::shared_ptr<WideBvh> wide = unfinished_copy(std::move(recycled));
  WideStorage& storage = wide->storage_;
  if (!current_but_for_stale) {
    copy_all(nodes(), storage.nodes);
    copy_all(blocks(), storage.blocks);
    storage.part_costs = storage_.part_costs;
  }
  Patch(memory_->plan(*this, moved), links, moved, storage).run(stale);
  wide->history_ = {
      {storage_.version, std::make_shared<const std::vector<std::uint32_t>>(std::move(changed))}};
  const std::size_t kept = std::min(history_.size(), kMaxHistory - 1);
  wide->history_.insert(wide->history_.end(), history_.begin(), history_.begin() + std::ptrdiff_t(kept));
  storage.version = memory_->next_version();
  return std::shared_ptr<const WideBvh>(std::move(wide));
}

}  // namespace gridcast::blas
