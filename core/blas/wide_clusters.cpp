#include "core/blas/wide_clusters.h"

#include <algorithm>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/vertex_rows.h"
#include "core/blas/wide_layout.h"

namespace gridcast::blas {
namespace {

/// Clusters that one task makes: some thousands of triangles.
constexpr std::size_t kTaskClusters = 128;

template <class Visit>
void for_each_cluster(std::size_t count, const Visit& visit) {
  oneapi::tbb::parallel_for(std::size_t(0), (count + kTaskClusters - 1) / kTaskClusters,
                            [&](std::size_t task) {
                              const std::size_t end = std::min(count, (task + 1) * kTaskClusters);
                              for (std::size_t i = task * kTaskClusters; i < end; ++i) visit(i);
                            });
}

std::uint32_t blocks_for(std::uint32_t triangles) {
  return (triangles + 3) / 4;
}

/// Where to divide five keys or more: where the curve leaves the largest cell, or at the place next to it at
/// which both parts together need no more blocks than the whole.
std::uint32_t divide(std::span<const MortonKey> keys) {
  const auto size = std::uint32_t(keys.size()), split = std::uint32_t(morton_split(keys));
  // By size % 4 and split % 4: both parts have a block that is not full, and one would do.
  constexpr std::int32_t kToPlace[4][4] = {{0, -1, 2, 1}, {0, 0, 0, 0}, {0, 1, 0, 0}, {0, -1, 1, 0}};
  const std::uint32_t least = (size - 1) % 4 + 1;
  return std::clamp(split + std::uint32_t(kToPlace[size % 4][split % 4]), least, size - least);
}

/// The largest slot in turn, until each is one block or there are eight.
WideCluster cluster_of(std::span<const MortonKey> keys, const KeyRange& range) {
  const std::span<const MortonKey> own = keys.subspan(range.begin, range.size());
  std::array<std::uint8_t, 9> ends{0, std::uint8_t(own.size())};
  std::uint32_t slots = 1, largest = 0, size = range.size();
  while (slots < 8 && size > 4) {
    const std::uint32_t middle = ends[largest] + divide(own.subspan(ends[largest], size));
    for (std::uint32_t i = slots++; i > largest; --i) ends[i + 1] = ends[i];
    ends[largest + 1] = std::uint8_t(middle);
    size = 0;
    for (std::uint32_t i = 0; i < slots; ++i) {
      const std::uint32_t length = ends[i + 1] - ends[i];
      largest = length > size ? i : largest;
      size = std::max(size, length);
    }
  }
  if (size > kMaxWideLeaf) {  // cells within cells, a few triangles in each: evenly instead
    const std::uint32_t blocks = blocks_for(range.size());
    slots = std::min(blocks, 8U);
    for (std::uint32_t i = 1; i <= slots; ++i)
      ends[i] = std::uint8_t(std::min(4 * (blocks * i / slots), range.size()));
  }
  WideCluster cluster{range.begin, 0, slots, {}};
  std::copy(ends.begin() + 1, ends.end(), cluster.ends.begin());
  return cluster;
}

std::uint32_t blocks_of(const WideCluster& cluster) {
  std::uint32_t blocks = 0;
  for (std::uint32_t slot = 0, begin = 0; slot < cluster.slots; begin = cluster.ends[slot++])
    blocks += blocks_for(cluster.ends[slot] - begin);
  return blocks;
}

/// Fills the blocks of clusters, and draws their nodes around them.
class Filler {
 public:
  Filler(std::span<const MortonKey> keys, const mesh::TriangleMesh& mesh, TriangleBlocks& blocks)
      : keys_(keys), triangles_(mesh.triangles.data()), vertices_(mesh), blocks_(blocks) {}

  /// Returns the box of all.
  Box4 fill(const WideCluster& cluster, WideNode& node) const {
    node = empty_node();
    node.slots = cluster.slots;
    Box4 whole;
    float largest = -1.F;
    std::uint32_t block = cluster.first_block, largest_slot = 0;
    for (std::uint32_t slot = 0, begin = 0; slot < cluster.slots; begin = cluster.ends[slot++]) {
      const std::span<const MortonKey> keys =
          keys_.subspan(cluster.first_key + begin, std::size_t(cluster.ends[slot]) - begin);
      const Box4 box = fill(keys, block);
      node.set_box(slot, box.bounds());
      const std::uint32_t blocks = blocks_for(std::uint32_t(keys.size()));
      node.child[slot] = wide_child::leaf(block, blocks);
      block += blocks;
      whole.extend(box);
      const Float4 e = box.extent();
      const float area = e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
      largest_slot = area > largest ? slot : largest_slot;
      largest = std::max(area, largest);
    }
    swap_slots(node, 0, largest_slot);
    return whole;
  }

 private:
  /// A leaf, from the block `first` on.
  [[nodiscard]] Box4 fill(std::span<const MortonKey> keys, std::uint32_t first) const {
    Box4 box;
    for (std::size_t begin = 0; begin < keys.size(); begin += 4) {
      TriangleBlock& block = blocks_[first + begin / 4];
      for (std::size_t lane = 0; lane < 4; ++lane)
        block.ids[lane] = morton_number(keys[std::min(begin + lane, keys.size() - 1)]);
      box.extend(load_rows(vertices_, triangles_, block));
    }
    return without_negative_zero(box);
  }

  std::span<const MortonKey> keys_;
  const mesh::Triangle* triangles_;
  VertexRows vertices_;
  TriangleBlocks& blocks_;
};

}  // namespace

WideClusters::WideClusters(std::span<const MortonKey> keys) {
  const std::vector<KeyRange> ranges = morton_ranges(keys, kClusterTriangles);
  all.resize(ranges.size());
  for_each_cluster(all.size(), [&](std::size_t i) { all[i] = cluster_of(keys, ranges[i]); });
  for (WideCluster& cluster : all) {
    cluster.first_block = block_count;
    block_count += blocks_of(cluster);
  }
}

void WideClusters::fill(std::span<const MortonKey> keys, const mesh::TriangleMesh& mesh,
                        TriangleBlocks& blocks) {
  nodes.resize(all.size());
  boxes.resize(all.size());
  blocks.resize(block_count);
  const Filler filler(keys, mesh, blocks);
  for_each_cluster(all.size(), [&](std::size_t i) {
    boxes[i] = BuildReference::make(filler.fill(all[i], nodes[i]), std::uint32_t(i));
  });
}

}  // namespace gridcast::blas
