#include "core/blas/refit_memory.h"

#include <algorithm>
#include <utility>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

namespace gridcast::blas {
namespace {

constexpr std::size_t kBlocksPerTask = 4096;

/// Calls visit(vertex) for every corner of a block, once a lane that is not repeated.
template <class Visit>
void for_each_vertex(const BlockCorners& corners, const Visit& visit) {
  for (const auto& lanes : corners.vertices)
    for (const std::uint32_t vertex : lanes) visit(vertex);
}

}  // namespace

BlockCorners corners_of(const TriangleBlock& block, const mesh::TriangleMesh& mesh) {
  BlockCorners corners{};
  bool last_vertex = false;
  for (std::size_t lane = 0; lane < 4; ++lane) {
    corners.ids[lane] = block.ids[lane];
    const mesh::Triangle& triangle = mesh.triangles[block.ids[lane]];
    for (std::size_t corner = 0; corner < 3; ++corner) {
      corners.vertices[corner][lane] = triangle[corner];
      last_vertex = last_vertex || triangle[corner] + std::size_t(1) == mesh.positions.size();
    }
  }
  if (last_vertex) corners.ids[3] |= BlockCorners::kLoadSingly;
  return corners;
}

RefitPlan::RefitPlan(const WideBvh& built, const mesh::TriangleMesh& mesh)
    : parts(built.nodes()), corners(built.blocks().size()) {
  using Range = oneapi::tbb::blocked_range<std::size_t>;
  oneapi::tbb::parallel_for(Range(0, corners.size(), kBlocksPerTask), [&](const Range& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i)
      corners[i] = corners_of(built.blocks()[i], mesh);
  });
  const auto own = part_sizes(built.nodes(), built.blocks(), parts);
  looseness = part_looseness(built.part_costs(), sizes_below(parts, own));
}

VertexLinks::VertexLinks(const WideNodes& nodes, const BlockCornersList& corners, std::size_t vertex_count)
    : first_block(vertex_count + 1, 0), node_of_block(corners.size()), parent(nodes.size(), 0) {
  // A counting sort by vertex; a vertex that several triangles of a block share is listed once.
  std::vector<std::uint32_t> last_seen(vertex_count, ~0U);
  const auto visit_new = [&](std::uint32_t block, const auto& visit) {
    for_each_vertex(corners[block], [&](std::uint32_t vertex) {
      if (std::exchange(last_seen[vertex], block) != block) visit(vertex);
    });
  };
  for (std::uint32_t block = 0; block < corners.size(); ++block)
    visit_new(block, [&](std::uint32_t vertex) { ++first_block[vertex + 1]; });
  for (std::size_t v = 0; v < vertex_count; ++v) first_block[v + 1] += first_block[v];
  blocks.resize(first_block.back());
  std::vector<std::uint32_t> next(first_block.begin(), first_block.end() - 1);
  std::fill(last_seen.begin(), last_seen.end(), ~0U);
  for (std::uint32_t block = 0; block < corners.size(); ++block)
    visit_new(block, [&](std::uint32_t vertex) { blocks[next[vertex]++] = block; });

  for (std::uint32_t node = 0; node < nodes.size(); ++node) {
    for (std::uint32_t slot = 0; slot < nodes[node].slots; ++slot) {
      const std::uint32_t link = nodes[node].child[slot];
      if (!wide_child::is_leaf(link)) {
        parent[link] = node;
        continue;
      }
      for (std::uint32_t b = 0; b < wide_child::block_count(link); ++b)
        node_of_block[wide_child::index(link) + b] = node;
    }
  }
}

// Isolated: a thread that waits for the plan must not take up a task that asks for it.
const RefitPlan& RefitMemory::plan_locked(const WideBvh& tree, const mesh::TriangleMesh& mesh) {
  if (!plan_) oneapi::tbb::this_task_arena::isolate([&] { plan_.emplace(tree, mesh); });
  return *plan_;
}

const RefitPlan& RefitMemory::plan(const WideBvh& tree, const mesh::TriangleMesh& mesh) {
  const std::lock_guard lock(mutex_);
  return plan_locked(tree, mesh);
}

const VertexLinks& RefitMemory::links(const WideBvh& tree, const mesh::TriangleMesh& mesh) {
  const std::lock_guard lock(mutex_);
  if (!links_) links_.emplace(tree.nodes(), plan_locked(tree, mesh).corners, mesh.positions.size());
  return *links_;
}

std::vector<PartLooseness> RefitMemory::planned_looseness() const {
  const std::lock_guard lock(mutex_);
  return plan_ ? plan_->looseness : std::vector<PartLooseness>();
}

std::uint64_t RefitMemory::next_version() {
  const std::lock_guard lock(mutex_);
  return ++last_version_;
}

WideStorage RefitMemory::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(spare_, {});
}

void RefitMemory::give_back(WideStorage storage) {
  const std::lock_guard lock(mutex_);
  if (!plan_ || storage.version == WideStorage::kUnfinished) return;
  // The newer one: it needs the fewest changes.
  if (spare_.nodes.empty() || spare_.version < storage.version) std::swap(spare_, storage);
}

std::size_t RefitMemory::memory_bytes() const {
  const std::lock_guard lock(mutex_);
  std::size_t bytes =
      spare_.nodes.capacity() * sizeof(WideNode) + spare_.blocks.capacity() * sizeof(TriangleBlock);
  if (plan_) {
    bytes += plan_->corners.capacity() * sizeof(BlockCorners) +
             plan_->parts.all.capacity() * sizeof(WidePart) +
             plan_->looseness.capacity() * sizeof(PartLooseness);
  }
  if (links_) {
    bytes += (links_->first_block.capacity() + links_->blocks.capacity() + links_->node_of_block.capacity() +
              links_->parent.capacity()) *
             sizeof(std::uint32_t);
  }
  return bytes;
}

}  // namespace gridcast::blas
