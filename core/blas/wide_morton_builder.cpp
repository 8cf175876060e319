#include "core/blas/wide_morton_builder.h"

#include <utility>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_reduce.h>

#include "core/blas/bvh_builder.h"
#include "core/blas/vertex_rows.h"
#include "core/blas/wide_clusters.h"
#include "core/blas/wide_collapse.h"
#include "core/blas/wide_layout.h"

namespace gridcast::blas {
namespace {

/// Triangles or nodes that one task reads.
constexpr std::size_t kGrain = std::size_t(1) << 13;
constexpr std::size_t kNodeGrain = 1024;

using Range = oneapi::tbb::blocked_range<std::size_t>;

/// Returns the bounds of the doubled centers of all triangles, with no -0 in them.
Box4 find_centers(const mesh::TriangleMesh& mesh, Centers& centers) {
  const VertexRows vertices(mesh);
  return oneapi::tbb::parallel_reduce(
      Range(0, centers.size(), kGrain), Box4{},
      [&](const Range& range, Box4 bounds) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          Box4 box;
          for (const std::uint32_t vertex : mesh.triangles[i]) box.extend(vertices(vertex));
          centers[i] = first_three(box.lower) + first_three(box.upper) + broadcast(0.F);
          bounds.extend(centers[i]);
        }
        return bounds;
      },
      [](Box4 a, const Box4& b) {
        a.extend(b);
        return a;
      });
}

MortonKeys sorted_keys(const mesh::TriangleMesh& mesh) {
  Centers centers(mesh.triangle_count());
  const Box4 bounds = find_centers(mesh, centers);
  return morton_order(centers, bounds);
}

/// Nodes of the tree over the clusters, and where the clusters' own are to be put among them.
class TopLayout {
 public:
  TopLayout(const BvhTree& top, const WideClusters& clusters)
      : top_(top), clusters_(clusters), collapse_(top, 1), place_of_(clusters.all.size()) {}

  /// Depth first: a node's inner children follow it, the first one at once.
  void run() {
    add(0, kNoParent, 0);
    while (!pending_.empty()) {
      const Pending next = pending_.back();
      pending_.pop_back();
      add(next.binary_node, next.parent, next.slot);
    }
  }

  void write(WideNodes& out) const {
    out.resize(count_);
    oneapi::tbb::parallel_for(Range(0, nodes_.size(), kNodeGrain), [&](const Range& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) out[nodes_[i].first] = nodes_[i].second;
    });
    const std::vector<WideCluster>& all = clusters_.all;
    oneapi::tbb::parallel_for(Range(0, all.size(), kNodeGrain), [&](const Range& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i)
        if (!all[i].is_leaf() || all.size() == 1) out[place_of_[i]] = clusters_.nodes[i];
    });
  }

 private:
  static constexpr std::uint32_t kNoParent = ~std::uint32_t(0);
  struct Pending {
    std::uint32_t binary_node, parent, slot;
  };

  /// `parent` is a place in nodes_.
  void add(std::uint32_t binary_node, std::uint32_t parent, std::uint32_t slot) {
    const std::uint32_t place = count_++;
    if (parent != kNoParent) nodes_[parent].second.child[slot] = place;
    const BvhNode& node = top_.nodes[binary_node];
    if (node.leaf()) {
      place_of_[cluster_of(node)] = place;
      return;
    }
    const auto index = std::uint32_t(nodes_.size());
    fill(collapse_.slots(binary_node), index, nodes_.emplace_back(place, empty_node()).second);
  }

  void fill(WideSlots slots, std::uint32_t index, WideNode& node) {
    for (std::uint32_t slot = 0; slot < slots.size; ++slot) {
      const BvhNode& binary = top_.nodes[slots.at[slot].binary_node];
      slots.at[slot].leaf = binary.leaf() && clusters_.all[cluster_of(binary)].is_leaf();
    }
    put_largest_leaf_first(top_, slots);
    node.slots = slots.size;
    for (std::uint32_t slot = 0; slot < slots.size; ++slot) {
      const BvhNode& binary = top_.nodes[slots.at[slot].binary_node];
      node.set_box(slot, binary.bounds());
      if (slots.at[slot].leaf) node.child[slot] = clusters_.nodes[cluster_of(binary)].child[0];
    }
    for (std::uint32_t slot = slots.size; slot-- > 0;)
      if (!slots.at[slot].leaf) pending_.push_back({slots.at[slot].binary_node, index, slot});
  }

  [[nodiscard]] std::uint32_t cluster_of(const BvhNode& leaf) const { return top_.primitive_ids[leaf.first]; }

  const BvhTree& top_;
  const WideClusters& clusters_;
  WideCollapse collapse_;
  std::vector<std::pair<std::uint32_t, WideNode>> nodes_;  ///< with their places
  std::vector<std::uint32_t> place_of_;                    ///< of the nodes of the clusters
  std::vector<Pending> pending_;
  std::uint32_t count_ = 0;
};

}  // namespace

Status build_wide_in_morton_order(const mesh::TriangleMesh& mesh, const std::stop_token& stop,
                                  WideNodes& nodes, TriangleBlocks& blocks) {
  const Error cancelled{ErrorCode::kCancelled, "the build was cancelled", {}};
  if (stop.stop_requested()) return cancelled;
  const MortonKeys keys = sorted_keys(mesh);
  if (stop.stop_requested()) return cancelled;
  WideClusters clusters(keys);
  clusters.fill(keys, mesh, blocks);
  const Result<BvhTree> top = build_bvh(clusters.boxes, stop);
  if (!top) return top.error();
  TopLayout layout(*top, clusters);
  layout.run();
  layout.write(nodes);
  return ok_status();
}

}  // namespace gridcast::blas
